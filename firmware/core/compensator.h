/* One sample of the consecutive compensator (14)-(20) with the compensation of the motor.
 *
 * The same sums in the same order as src/swingid/control/law.py:compensator_step, so the same bits, if the compiler
 * fuses nothing (-ffp-contract=off) and double is IEEE 754 binary64. No heap, no libm.
 *
 * SWINGID_SINGLE: the chain of filters (16), which is nearly all that a sample costs from order 2 on, is computed in
 * single precision, which the floating-point unit of a Cortex-M4 has; guard, gain, wheel and motor stay doubles. Its
 * voltages are no longer those of the twin (firmware/README.md says by how much), so no image that is shipped has it.
 */
#ifndef SWINGID_COMPENSATOR_H
#define SWINGID_COMPENSATOR_H

#define SWINGID_MOST_ORDER 4 /* rho - 1 */

/* Places in the state. */
enum { SWINGID_K_TILDE, SWINGID_FILTERED_ERROR, SWINGID_WHEEL_MEMORY, SWINGID_WHEEL_SEEN, SWINGID_XI };

/* Places in the parameters; alpha (order + 1 numbers) and k (order numbers) follow from SWINGID_ALPHA on. */
enum {
    SWINGID_ORDER,
    SWINGID_SAMPLE_TIME,
    SWINGID_DELTA0,
    SWINGID_LAMBDA0,
    SWINGID_SIGMA0,
    SWINGID_K_TILDE_MAX,
    SWINGID_ERROR_DECAY,
    SWINGID_WHEEL_DECAY,
    SWINGID_PLANT_SIGN,
    SWINGID_DIFFERENTIATE_GAIN,
    SWINGID_LIMIT,
    SWINGID_COULOMB,
    SWINGID_DEAD_NEGATIVE,
    SWINGID_DEAD_POSITIVE,
    SWINGID_BACK_EMF,
    SWINGID_ALPHA
};

#define SWINGID_STATES (SWINGID_XI + SWINGID_MOST_ORDER)
#define SWINGID_GAINS (SWINGID_ALPHA + 2 * SWINGID_MOST_ORDER + 1)

/* exp(-x) for x >= 0; beyond 708 it is 0, below 0 it is 1. */
double swingid_decay(double x);

/* Voltage (V) to hold to the next sample; moves `state` (SWINGID_STATES numbers) on by one sample.
 * reference, angle, wheel_angle: rad. parameters: as Compensator.parameters gives them, order 0 to 4. */
double swingid_compensator_step(double reference, double angle, double wheel_angle, double *state,
                                const double *parameters);

#endif
