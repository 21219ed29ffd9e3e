/* Many controller steps in one call, for the comparison with Python. */
#include "compensator.h"

void steps(int count, const double *inputs, double *state, const double *parameters, double *voltages, double *states) {
    for (int i = 0; i < count; i++) {
        const double *row = inputs + 3 * i;
        voltages[i] = swingid_compensator_step(row[0], row[1], row[2], state, parameters);
        for (int j = 0; j < SWINGID_STATES; j++) states[i * SWINGID_STATES + j] = state[j];
    }
}
