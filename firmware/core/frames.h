/* Made by tools/generate_frames.py from src/swingid/live/swingid.dbc; change that. */
#ifndef SWINGID_FRAMES_H
#define SWINGID_FRAMES_H

#include <stdint.h>

#define SWINGID_SCHEMA 2011962488u
#define SWINGID_MOST_PAYLOAD 64

enum {
    SWINGID_STATE_IDLE = 0,
    SWINGID_STATE_ARMED = 1,
    SWINGID_STATE_RUNNING = 2,
    SWINGID_STATE_STOPPING = 3,
    SWINGID_STATE_FAULT = 4
};

enum {
    SWINGID_FAULTCODE_NONE = 0,
    SWINGID_FAULTCODE_HEARTBEAT = 1,
    SWINGID_FAULTCODE_ANGLE = 2,
    SWINGID_FAULTCODE_SPEED = 3,
    SWINGID_FAULTCODE_WHEEL_SPEED = 4,
    SWINGID_FAULTCODE_VOLTAGE = 5,
    SWINGID_FAULTCODE_CURRENT = 6,
    SWINGID_FAULTCODE_AXIS_FROZEN = 7,
    SWINGID_FAULTCODE_WHEEL_FROZEN = 8,
    SWINGID_FAULTCODE_AXIS_JUMP = 9,
    SWINGID_FAULTCODE_WHEEL_JUMP = 10,
    SWINGID_FAULTCODE_OVERRUN = 11,
    SWINGID_FAULTCODE_ENCODER = 12
};

enum {
    SWINGID_STATUS_DONE = 0,
    SWINGID_STATUS_WRONG_STATE = 1,
    SWINGID_STATUS_BAD_VALUE = 2,
    SWINGID_STATUS_BAD_PARAMETERS = 3,
    SWINGID_STATUS_NO_PARAMETERS = 4,
    SWINGID_STATUS_WRONG_SESSION = 5,
    SWINGID_STATUS_GAP = 6,
    SWINGID_STATUS_FULL = 7,
    SWINGID_STATUS_NO_REFERENCE = 8,
    SWINGID_STATUS_OVER_LIMIT = 9,
    SWINGID_STATUS_TOO_FAST = 10
};

enum {
    SWINGID_STOPMODE_HARD = 0,
    SWINGID_STOPMODE_SOFT = 1
};

enum {
    SWINGID_MODE_CLOSED_LOOP = 0,
    SWINGID_MODE_OPEN_LOOP = 1
};

enum {
    SWINGID_FLAG_CLAMPED = 1,
    SWINGID_FLAG_STARVED = 2,
    SWINGID_FLAG_FINISHED = 4,
    SWINGID_FLAG_FADING = 8,
    SWINGID_FLAG_INVALID = 16,
    SWINGID_FLAG_LATE = 32,
    SWINGID_FLAG_DROPPED = 64,
    SWINGID_FLAG_BAD_FRAME = 128
};

#define SWINGID_STOP 16
#define SWINGID_STOP_LENGTH 4
typedef struct {
    uint16_t session;
    uint8_t mode;
} swingid_stop;
void swingid_pack_stop(uint8_t *payload, const swingid_stop *frame);
void swingid_unpack_stop(swingid_stop *frame, const uint8_t *payload);

#define SWINGID_FAULT 17
#define SWINGID_FAULT_LENGTH 16
typedef struct {
    uint32_t sequence;
    uint32_t time;
    uint8_t code;
    uint8_t state;
    float value;
} swingid_fault;
void swingid_pack_fault(uint8_t *payload, const swingid_fault *frame);
void swingid_unpack_fault(swingid_fault *frame, const uint8_t *payload);

#define SWINGID_HEARTBEAT 32
#define SWINGID_HEARTBEAT_LENGTH 4
typedef struct {
    uint16_t session;
    uint16_t count;
} swingid_heartbeat;
void swingid_pack_heartbeat(uint8_t *payload, const swingid_heartbeat *frame);
void swingid_unpack_heartbeat(swingid_heartbeat *frame, const uint8_t *payload);

#define SWINGID_CLEAR 48
#define SWINGID_CLEAR_LENGTH 4
typedef struct {
    uint16_t session;
} swingid_clear;
void swingid_pack_clear(uint8_t *payload, const swingid_clear *frame);
void swingid_unpack_clear(swingid_clear *frame, const uint8_t *payload);

#define SWINGID_WHO 64
#define SWINGID_WHO_LENGTH 4
typedef struct {
    uint32_t schema;
} swingid_who;
void swingid_pack_who(uint8_t *payload, const swingid_who *frame);
void swingid_unpack_who(swingid_who *frame, const uint8_t *payload);

#define SWINGID_HELLO 65
#define SWINGID_HELLO_LENGTH 32
typedef struct {
    uint32_t schema;
    uint32_t firmware;
    uint16_t version;
    uint8_t state;
    uint8_t fault;
    float rate;
    uint32_t axis_counts;
    uint32_t wheel_counts;
    float voltage_limit;
    uint16_t parameter_room;
    uint16_t reference_room;
} swingid_hello;
void swingid_pack_hello(uint8_t *payload, const swingid_hello *frame);
void swingid_unpack_hello(swingid_hello *frame, const uint8_t *payload);

#define SWINGID_PARAMETERS 80
#define SWINGID_PARAMETERS_LENGTH 64
typedef struct {
    uint16_t index;
    uint16_t count;
    uint16_t total;
    double value[7];
} swingid_parameters;
void swingid_pack_parameters(uint8_t *payload, const swingid_parameters *frame);
void swingid_unpack_parameters(swingid_parameters *frame, const uint8_t *payload);

#define SWINGID_REFERENCE 81
#define SWINGID_REFERENCE_LENGTH 64
typedef struct {
    uint32_t start;
    uint8_t count;
    uint8_t last;
    uint16_t session;
    float value[14];
} swingid_reference;
void swingid_pack_reference(uint8_t *payload, const swingid_reference *frame);
void swingid_unpack_reference(swingid_reference *frame, const uint8_t *payload);

#define SWINGID_ARM 82
#define SWINGID_ARM_LENGTH 8
typedef struct {
    uint16_t session;
    uint8_t mode;
    uint16_t parameters;
    uint16_t fade;
} swingid_arm;
void swingid_pack_arm(uint8_t *payload, const swingid_arm *frame);
void swingid_unpack_arm(swingid_arm *frame, const uint8_t *payload);

#define SWINGID_RUN 83
#define SWINGID_RUN_LENGTH 4
typedef struct {
    uint16_t session;
} swingid_run;
void swingid_pack_run(uint8_t *payload, const swingid_run *frame);
void swingid_unpack_run(swingid_run *frame, const uint8_t *payload);

#define SWINGID_SAMPLE 96
#define SWINGID_SAMPLE_LENGTH 32
typedef struct {
    uint32_t sequence;
    uint32_t time;
    int32_t axis;
    int32_t wheel;
    float voltage;
    float gain;
    float current;
    uint16_t flags;
    uint8_t state;
    uint8_t fault;
} swingid_sample;
void swingid_pack_sample(uint8_t *payload, const swingid_sample *frame);
void swingid_unpack_sample(swingid_sample *frame, const uint8_t *payload);

#define SWINGID_ACK 97
#define SWINGID_ACK_LENGTH 12
typedef struct {
    uint16_t message;
    uint8_t status;
    uint8_t state;
    uint32_t next;
    uint32_t value;
} swingid_ack;
void swingid_pack_ack(uint8_t *payload, const swingid_ack *frame);
void swingid_unpack_ack(swingid_ack *frame, const uint8_t *payload);

/* Length of the payload of a message of the host, -1 for any other identifier. */
int swingid_length_from_host(uint16_t id);

/* The 8 bytes of a number, least significant first. */
void swingid_put_f64(uint8_t *bytes, double number);

#endif
