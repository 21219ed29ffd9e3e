#include "guard.h"

#include "frames.h"

static double size_of(double x) { return x < 0.0 ? -x : x; }

static int finite(double x) { return x - x == 0.0; }

void swingid_guard_init(swingid_guard *guard, const swingid_config *config) {
    const double period = 1e6 / (double)config->rate;
    guard->seen = guard->late = guard->fresh = 0;
    guard->place = guard->time = guard->heartbeat = guard->idle_time = 0;
    guard->axis_raw = guard->wheel_raw = 0;
    guard->axis = guard->wheel = guard->axis_change = guard->wheel_change = 0;
    guard->late_time = (uint32_t)(1.5 * period);
    /* a heartbeat counts from the sample after it on, so that 0 V is there in time */
    guard->death_time = SWINGID_HEARTBEAT_TIME - (period < 50000.0 ? (uint32_t)period : 50000u);
    for (int i = 0; i < SWINGID_MOST_SPAN; i++) guard->axis_past[i] = guard->wheel_past[i] = 0;
    swingid_guard_arm(guard);
}

void swingid_guard_arm(swingid_guard *guard) {
    guard->fresh = 1;
    guard->invalid = guard->axis_frozen = guard->wheel_frozen = guard->saturated = 0;
}

void swingid_guard_track(swingid_guard *guard, const swingid_inputs *inputs, int busy) {
    if (!guard->seen) {
        guard->seen = 1;
        guard->idle_time = inputs->time;
        guard->axis = inputs->axis;
        guard->wheel = inputs->wheel;
        for (int i = 0; i < SWINGID_MOST_SPAN; i++) {
            guard->axis_past[i] = guard->axis;
            guard->wheel_past[i] = guard->wheel;
        }
        guard->axis_change = guard->wheel_change = 0;
        guard->late = 0;
    } else {
        guard->late = inputs->time - guard->time > guard->late_time;
        guard->axis_change = (int32_t)((uint32_t)inputs->axis - (uint32_t)guard->axis_raw);
        guard->wheel_change = (int32_t)((uint32_t)inputs->wheel - (uint32_t)guard->wheel_raw);
        guard->axis += guard->axis_change;
        guard->wheel += guard->wheel_change;
    }
    guard->time = inputs->time;
    guard->axis_raw = inputs->axis;
    guard->wheel_raw = inputs->wheel;
    guard->axis_past[guard->place] = guard->axis;
    guard->wheel_past[guard->place] = guard->wheel;
    guard->place = (guard->place + 1) % SWINGID_MOST_SPAN;
    if (!busy) guard->idle_time = inputs->time;
    if (guard->fresh) { /* it may have waited behind other bytes, but was sent after the link was last empty */
        guard->fresh = 0;
        guard->heartbeat = guard->idle_time;
    }
    guard->invalid = inputs->valid ? 0 : guard->invalid < 60000 ? guard->invalid + 1 : guard->invalid;
}

/* Speed over `span` samples (1 to SWINGID_MOST_SPAN - 1). */
static double speed(const swingid_guard *guard, const int64_t *past, int64_t now, double step, const double *p) {
    const uint32_t span = (uint32_t)p[SWINGID_SPEED_SPAN];
    const uint32_t then = (guard->place + 2 * SWINGID_MOST_SPAN - 1 - span) % SWINGID_MOST_SPAN;
    return (double)(now - past[then]) * step / ((double)span * p[SWINGID_CONTROLLER + SWINGID_SAMPLE_TIME]);
}

static uint32_t frozen(uint32_t count, int64_t change, double voltage, const double *p) {
    return change != 0 || size_of(voltage) < p[SWINGID_FROZEN_VOLTAGE] ? 0 : count + 1;
}

int swingid_guard_check(swingid_guard *guard, const swingid_inputs *inputs, const double *p, double voltage,
                        double *value) {
    const int wheel = p[SWINGID_WHEEL_STEP] != 0.0;
    const double still = p[SWINGID_FROZEN_SAMPLES];
    guard->axis_frozen = frozen(guard->axis_frozen, guard->axis_change, voltage, p);
    guard->wheel_frozen = wheel ? frozen(guard->wheel_frozen, guard->wheel_change, voltage, p) : 0;

    *value = 0.0;
    if (guard->late) return SWINGID_FAULTCODE_OVERRUN;
    *value = (double)(uint32_t)(guard->time - guard->heartbeat);
    if (*value >= (double)guard->death_time) return SWINGID_FAULTCODE_HEARTBEAT;
    *value = (double)guard->invalid;
    if (guard->invalid >= SWINGID_INVALID_SAMPLES) return SWINGID_FAULTCODE_ENCODER;
    *value = (double)guard->axis_change;
    if (size_of(*value) > p[SWINGID_AXIS_JUMP]) return SWINGID_FAULTCODE_AXIS_JUMP;
    *value = (double)guard->wheel_change;
    if (wheel && size_of(*value) > p[SWINGID_WHEEL_JUMP]) return SWINGID_FAULTCODE_WHEEL_JUMP;
    *value = (double)(guard->axis - (int64_t)p[SWINGID_AXIS_ZERO]) * p[SWINGID_AXIS_STEP];
    if (size_of(*value) > p[SWINGID_ANGLE_LIMIT]) return SWINGID_FAULTCODE_ANGLE;
    *value = speed(guard, guard->axis_past, guard->axis, p[SWINGID_AXIS_STEP], p);
    if (size_of(*value) > p[SWINGID_SPEED_LIMIT]) return SWINGID_FAULTCODE_SPEED;
    *value = speed(guard, guard->wheel_past, guard->wheel, p[SWINGID_WHEEL_STEP], p);
    if (size_of(*value) > p[SWINGID_WHEEL_SPEED_LIMIT]) return SWINGID_FAULTCODE_WHEEL_SPEED;
    *value = (double)inputs->current;
    if (size_of(*value) > p[SWINGID_CURRENT_LIMIT]) return SWINGID_FAULTCODE_CURRENT;
    *value = (double)guard->axis_frozen;
    if (*value >= still) return SWINGID_FAULTCODE_AXIS_FROZEN;
    *value = (double)guard->wheel_frozen;
    if (*value >= still) return SWINGID_FAULTCODE_WHEEL_FROZEN;
    return SWINGID_FAULTCODE_NONE;
}

int swingid_guard_voltage(swingid_guard *guard, const swingid_config *config, const double *p, double *voltage,
                          int *clamped, double *value) {
    double limit = p[SWINGID_VOLTAGE_LIMIT];
    if ((double)config->voltage_limit < limit) limit = (double)config->voltage_limit;
    *clamped = 0;
    *value = 0.0;
    if (!finite(*voltage)) return SWINGID_FAULTCODE_VOLTAGE;
    guard->saturated = size_of(*voltage) < limit ? 0 : guard->saturated + 1;
    *clamped = size_of(*voltage) > limit;
    if (*voltage > limit) *voltage = limit;
    if (*voltage < -limit) *voltage = -limit;
    *value = *voltage;
    return (double)guard->saturated > p[SWINGID_SATURATED_SAMPLES] ? SWINGID_FAULTCODE_VOLTAGE : SWINGID_FAULTCODE_NONE;
}

int swingid_guard_counts(const double *p, const swingid_config *config) {
    const double most = (double)config->most_edges;
    return most == 0.0 || p[SWINGID_WHEEL_SPEED_LIMIT] <= most * size_of(p[SWINGID_WHEEL_STEP]);
}

/* Whether a number is whole and within bounds that an int32_t holds. */
static int whole(double x, double least, double most) {
    return x >= least && x <= most && (double)(int64_t)x == x;
}

int swingid_parameters_valid(const double *p, int count, const swingid_config *config) {
    static const int finite_limits[] = {SWINGID_ANGLE_LIMIT, SWINGID_SPEED_LIMIT, SWINGID_VOLTAGE_LIMIT};
    const double *c = p + SWINGID_CONTROLLER;
    int order;
    if (count < SWINGID_CONTROLLER + SWINGID_ALPHA + 1 || count > SWINGID_MOST_PARAMETERS) return 0;
    if (!whole(c[SWINGID_ORDER], 0.0, SWINGID_MOST_ORDER)) return 0;
    order = (int)c[SWINGID_ORDER];
    if (count != SWINGID_CONTROLLER + SWINGID_ALPHA + 2 * order + 1) return 0;
    for (int i = 0; i < count; i++) {
        const int limit = (i >= SWINGID_ANGLE_LIMIT && i <= SWINGID_FROZEN_VOLTAGE) ||
                          i == SWINGID_CONTROLLER + SWINGID_LIMIT || i == SWINGID_CONTROLLER + SWINGID_K_TILDE_MAX;
        if (limit ? !(p[i] >= 0.0) : !finite(p[i])) return 0; /* a limit may be infinite */
    }
    for (int i = 0; i < 3; i++) {
        if (!finite(p[finite_limits[i]]) || p[finite_limits[i]] == 0.0) return 0;
    }
    if (p[SWINGID_AXIS_STEP] == 0.0 || !whole(p[SWINGID_AXIS_ZERO], -2147483648.0, 2147483647.0)) return 0;
    if (p[SWINGID_VOLTAGE_SIGN] != 1.0 && p[SWINGID_VOLTAGE_SIGN] != -1.0) return 0;
    if (!(p[SWINGID_START_GAIN] >= 0.0)) return 0;
    if (!whole(p[SWINGID_FROZEN_SAMPLES], 1.0, 60000.0) || !whole(p[SWINGID_SATURATED_SAMPLES], 0.0, 60000.0)) return 0;
    if (!whole(p[SWINGID_SPEED_SPAN], 1.0, SWINGID_MOST_SPAN - 1)) return 0;
    if (c[SWINGID_SAMPLE_TIME] != 1.0 / (double)config->rate) return 0;
    for (int i = SWINGID_ERROR_DECAY; i <= SWINGID_WHEEL_DECAY; i++) {
        if (!(c[i] >= 0.0 && c[i] < 1.0)) return 0;
    }
    return c[SWINGID_LIMIT] > 0.0;
}
