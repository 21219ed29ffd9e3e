/* What ends a run at 0 V whatever the host does; the same decisions as src/swingid/live/guard.py. */
#ifndef SWINGID_GUARD_H
#define SWINGID_GUARD_H

#include <stdint.h>

#include "compensator.h"

/* Places in the parameters; those of the controller follow from SWINGID_CONTROLLER on. */
enum {
    SWINGID_AXIS_STEP,         /* rad per count, with its sign */
    SWINGID_WHEEL_STEP,        /* rad per count, with its sign; 0 without a wheel */
    SWINGID_AXIS_ZERO,         /* counts where the body hangs */
    SWINGID_VOLTAGE_SIGN,      /* 1 or -1: of the output against the controller's voltage */
    SWINGID_REST,              /* rad, the reference's hanging value, where a soft stop ends */
    SWINGID_START_GAIN,        /* k tilde at the start */
    SWINGID_ANGLE_LIMIT,       /* rad */
    SWINGID_SPEED_LIMIT,       /* rad/s */
    SWINGID_WHEEL_SPEED_LIMIT, /* rad/s */
    SWINGID_VOLTAGE_LIMIT,     /* V */
    SWINGID_CURRENT_LIMIT,     /* A */
    SWINGID_AXIS_JUMP,         /* counts from one sample to the next */
    SWINGID_WHEEL_JUMP,        /* counts */
    SWINGID_FROZEN_VOLTAGE,    /* V: from here on the counts must change ... */
    SWINGID_FROZEN_SAMPLES,    /* ... within so many samples */
    SWINGID_SATURATED_SAMPLES, /* so many samples at the limit of the voltage and no more */
    SWINGID_SPEED_SPAN,        /* samples over which a speed is taken */
    SWINGID_CONTROLLER
};

#define SWINGID_MOST_PARAMETERS (SWINGID_CONTROLLER + SWINGID_GAINS)
#define SWINGID_MOST_SPAN 32
#define SWINGID_HEARTBEAT_TIME 100000u /* us */
#define SWINGID_INVALID_SAMPLES 5

typedef struct {
    uint32_t time;       /* us, wraps */
    int32_t axis, wheel; /* raw counts, wrap */
    float current;       /* A, not a number where it is not measured */
    int valid;           /* 0: an encoder gave no reading and its last one is repeated */
} swingid_inputs;

typedef struct {
    float rate; /* samples per second, 20 or more */
    uint32_t axis_counts, wheel_counts;
    float voltage_limit;
    uint32_t firmware; /* hash of what runs */
    int most_order;    /* of a controller that it computes between two samples, 0 to SWINGID_MOST_ORDER */
    float most_edges;  /* counts of the wheel a second that it can follow, 0 where no speed is too high */
} swingid_config;

typedef struct {
    int64_t axis, wheel; /* counts without wraps */
    int64_t axis_change, wheel_change;
    int64_t axis_past[SWINGID_MOST_SPAN], wheel_past[SWINGID_MOST_SPAN];
    uint32_t place; /* of the next entry of the past */
    uint32_t time, heartbeat, late_time, death_time;
    uint32_t idle_time; /* of the last sample at which nothing more of the host waited */
    int32_t axis_raw, wheel_raw;
    int seen, late, fresh;
    uint32_t invalid, axis_frozen, wheel_frozen, saturated;
} swingid_guard;

void swingid_guard_init(swingid_guard *guard, const swingid_config *config);

/* Begin to watch: forget what was counted before. */
void swingid_guard_arm(swingid_guard *guard);

/* Take one sample's readings, in every state; busy: more of the host may wait than this sample has taken. */
void swingid_guard_track(swingid_guard *guard, const swingid_inputs *inputs, int busy);

/* The first fault of this sample, and what passed its limit; `voltage` was held up to it. */
int swingid_guard_check(swingid_guard *guard, const swingid_inputs *inputs, const double *parameters, double voltage,
                        double *value);

/* Voltage within its limit: SWINGID_FAULTCODE_NONE or _VOLTAGE; `clamped` says whether it was changed. */
int swingid_guard_voltage(swingid_guard *guard, const swingid_config *config, const double *parameters,
                          double *voltage, int *clamped, double *value);

/* Whether the board follows the wheel's counts up to the speed at which the guard ends the run. */
int swingid_guard_counts(const double *parameters, const swingid_config *config);

/* Whether so many parameters can be run with at all. */
int swingid_parameters_valid(const double *parameters, int count, const swingid_config *config);

#endif
