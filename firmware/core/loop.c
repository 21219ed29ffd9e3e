#include "hal.h"

static swingid_device device;

void swingid_loop(const swingid_config *config) {
    static uint8_t incoming[128], pending[SWINGID_OUTPUT_ROOM];
    const int most = swingid_most_taken(config);
    int size = 0, sent = 0, count, taken;
    swingid_inputs inputs;
    float voltage;
    swingid_init(&device, config);
    for (;;) {
        for (taken = 0; taken < most; taken += count) { /* bounded, so that no host keeps it from its samples */
            const int left = most - taken;
            count = hal_receive(incoming, left < (int)sizeof incoming ? left : (int)sizeof incoming);
            if (count <= 0) break;
            swingid_receive(&device, incoming, count);
        }
        device.busy = taken == most;
        if (!hal_wait()) break;
        hal_read(&inputs);
        voltage = swingid_tick(&device, &inputs); /* nothing of changing length comes between reading and applying */
        hal_apply(voltage, swingid_armed(&device));
        if (sent == size) {
            size = swingid_output(&device, pending, (int)sizeof pending);
            sent = 0;
        }
        if (sent < size) sent += hal_send(pending + sent, size - sent);
    }
    hal_apply(0.0f, 0);
}
