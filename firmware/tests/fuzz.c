/* Bytes from a file into a device, with samples between them; stops at a voltage that must not be. Made with
 * -fsanitize=address,undefined. The file holds records: kind (0 bytes, 1 samples, 2 a new device), length, bytes.
 */
#include <stdio.h>
#include <stdlib.h>

#include "device.h"

static const swingid_config config = {1000.0f, 16384, 16384, 10.0f, 1, SWINGID_MOST_ORDER, 0};

int main(int count, char **arguments) {
    static swingid_device device;
    static uint8_t bytes[65536], out[SWINGID_OUTPUT_ROOM];
    FILE *file = count == 2 ? fopen(arguments[1], "rb") : NULL;
    unsigned long records = 0, samples = 0, driven = 0;
    swingid_inputs inputs = {0, 0, 0, 0.0f, 1};
    int kind;
    if (file == NULL) return 2;
    swingid_init(&device, &config);
    while ((kind = fgetc(file)) != EOF) {
        size_t length = (size_t)fgetc(file);
        length |= (size_t)fgetc(file) << 8;
        if (fread(bytes, 1, length, file) != length) return 2;
        records++;
        if (kind == 2) swingid_init(&device, &config);
        if (kind == 0) {
            uint8_t *piece = malloc(length); /* of its own, so that a byte beyond it is seen */
            for (size_t i = 0; i < length; i++) piece[i] = bytes[i];
            swingid_receive(&device, piece, (int)length);
            free(piece);
        }
        for (size_t i = 0; kind == 1 && i < length; i++) {
            const int may = device.state == SWINGID_STATE_RUNNING || device.state == SWINGID_STATE_STOPPING;
            float voltage;
            inputs.time += 1000;
            inputs.axis += (int8_t)bytes[i] % 3;
            inputs.wheel += (int8_t)bytes[i] % 50;
            voltage = swingid_tick(&device, &inputs);
            samples++;
            driven += voltage != 0.0f;
            if (!(voltage >= -10.0f && voltage <= 10.0f) || (voltage != 0.0f && !may)) {
                printf("record %lu: %g V in state %d\n", records, (double)voltage, device.state);
                return 1;
            }
        }
        while (swingid_output(&device, out, (int)sizeof out) > 0) {
        }
    }
    printf("%lu records, %lu samples, %lu of them with a voltage\n", records, samples, driven);
    fclose(file);
    return 0;
}
