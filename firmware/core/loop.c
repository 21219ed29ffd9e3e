#include "hal.h"

static swingid_device device;

void swingid_loop(const swingid_config *config) {
    static uint8_t incoming[128], pending[SWINGID_OUTPUT_ROOM];
    int size = 0, sent = 0, count;
    swingid_inputs inputs;
    swingid_init(&device, config);
    for (;;) {
        while ((count = hal_receive(incoming, (int)sizeof incoming)) > 0) swingid_receive(&device, incoming, count);
        if (!hal_wait()) break;
        hal_read(&inputs);
        hal_apply(swingid_tick(&device, &inputs)); /* nothing of changing length comes between these two */
        if (sent == size) {
            size = swingid_output(&device, pending, (int)sizeof pending);
            sent = 0;
        }
        if (sent < size) sent += hal_send(pending + sent, size - sent);
    }
    hal_apply(0.0f);
}
