/* The core as plain functions on one device, for a program that is board and plant at once: Python by ctypes, or an
 * emulated processor, whose addresses `sim_table` holds.
 */
#include "device.h"

static swingid_device device;

uint8_t sim_bytes[4096]; /* in and out */

void sim_open(float rate, uint32_t axis_counts, uint32_t wheel_counts, float voltage_limit, uint32_t firmware,
              float most_edges) {
    swingid_config config;
    config.rate = rate;
    config.axis_counts = axis_counts;
    config.wheel_counts = wheel_counts;
    config.voltage_limit = voltage_limit;
    config.firmware = firmware;
    config.most_order = SWINGID_MOST_ORDER;
    config.most_edges = most_edges;
    swingid_init(&device, &config);
}

/* Take the first `size` bytes of sim_bytes from the host. */
void sim_receive(int size) { swingid_receive(&device, sim_bytes, size); }

/* Whether the host has sent as much as a sample takes. */
void sim_busy(int busy) { device.busy = busy; }

/* The voltage's bits. */
uint32_t sim_tick(uint32_t time, int32_t axis, int32_t wheel, uint32_t current, int valid) {
    union {
        float number;
        uint32_t bits;
    } same;
    swingid_inputs inputs;
    same.bits = current;
    inputs.time = time;
    inputs.axis = axis;
    inputs.wheel = wheel;
    inputs.current = same.number;
    inputs.valid = valid;
    same.number = swingid_tick(&device, &inputs);
    return same.bits;
}

/* Output of the device into sim_bytes; how many bytes. */
int sim_output(void) { return swingid_output(&device, sim_bytes, (int)sizeof sim_bytes); }

/* The same on a CAN bus: a message in, and the next one out; the payload in sim_bytes, its length, -1 without one. */
void sim_message(uint16_t id, int length) { swingid_message(&device, id, sim_bytes, length); }
int sim_output_message(uint16_t *id) { return swingid_output_message(&device, id, sim_bytes); }

/* So many controller steps in one call: rows of reference, angle, wheel angle. */
void sim_steps(int count, const double *inputs, double *state, const double *parameters, double *voltages,
               double *states) {
    for (int i = 0; i < count; i++) {
        const double *row = inputs + 3 * i;
        voltages[i] = swingid_compensator_step(row[0], row[1], row[2], state, parameters);
        for (int j = 0; j < SWINGID_STATES; j++) states[i * SWINGID_STATES + j] = state[j];
    }
}
