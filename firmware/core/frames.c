/* Made by tools/generate_frames.py from src/swingid/live/swingid.dbc; change that. */
#include "frames.h"

static void put_u8(uint8_t *p, uint8_t x) { p[0] = x; }
static void put_u16(uint8_t *p, uint16_t x) {
    p[0] = (uint8_t)x;
    p[1] = (uint8_t)(x >> 8);
}
static void put_u32(uint8_t *p, uint32_t x) {
    put_u16(p, (uint16_t)x);
    put_u16(p + 2, (uint16_t)(x >> 16));
}
static void put_i32(uint8_t *p, int32_t x) { put_u32(p, (uint32_t)x); }
static void put_f32(uint8_t *p, float x) {
    union {
        float number;
        uint32_t bits;
    } same;
    same.number = x;
    put_u32(p, same.bits);
}
void swingid_put_f64(uint8_t *p, double x) {
    union {
        double number;
        uint64_t bits;
    } same;
    same.number = x;
    put_u32(p, (uint32_t)same.bits);
    put_u32(p + 4, (uint32_t)(same.bits >> 32));
}
#define put_f64 swingid_put_f64

static uint8_t get_u8(const uint8_t *p) { return p[0]; }
static uint16_t get_u16(const uint8_t *p) { return (uint16_t)(p[0] | (uint16_t)(p[1] << 8)); }
static uint32_t get_u32(const uint8_t *p) { return get_u16(p) | (uint32_t)get_u16(p + 2) << 16; }
static int32_t get_i32(const uint8_t *p) { return (int32_t)get_u32(p); }
static float get_f32(const uint8_t *p) {
    union {
        float number;
        uint32_t bits;
    } same;
    same.bits = get_u32(p);
    return same.number;
}
static double get_f64(const uint8_t *p) {
    union {
        double number;
        uint64_t bits;
    } same;
    same.bits = get_u32(p) | (uint64_t)get_u32(p + 4) << 32;
    return same.number;
}

void swingid_pack_stop(uint8_t *payload, const swingid_stop *frame) {
    for (int i = 0; i < 4; i++) payload[i] = 0;
    put_u16(payload + 0, frame->session);
    put_u8(payload + 2, frame->mode);
}

void swingid_unpack_stop(swingid_stop *frame, const uint8_t *payload) {
    frame->session = get_u16(payload + 0);
    frame->mode = get_u8(payload + 2);
}

void swingid_pack_fault(uint8_t *payload, const swingid_fault *frame) {
    for (int i = 0; i < 16; i++) payload[i] = 0;
    put_u32(payload + 0, frame->sequence);
    put_u32(payload + 4, frame->time);
    put_u8(payload + 8, frame->code);
    put_u8(payload + 9, frame->state);
    put_f32(payload + 12, frame->value);
}

void swingid_unpack_fault(swingid_fault *frame, const uint8_t *payload) {
    frame->sequence = get_u32(payload + 0);
    frame->time = get_u32(payload + 4);
    frame->code = get_u8(payload + 8);
    frame->state = get_u8(payload + 9);
    frame->value = get_f32(payload + 12);
}

void swingid_pack_heartbeat(uint8_t *payload, const swingid_heartbeat *frame) {
    for (int i = 0; i < 4; i++) payload[i] = 0;
    put_u16(payload + 0, frame->session);
    put_u16(payload + 2, frame->count);
}

void swingid_unpack_heartbeat(swingid_heartbeat *frame, const uint8_t *payload) {
    frame->session = get_u16(payload + 0);
    frame->count = get_u16(payload + 2);
}

void swingid_pack_clear(uint8_t *payload, const swingid_clear *frame) {
    for (int i = 0; i < 4; i++) payload[i] = 0;
    put_u16(payload + 0, frame->session);
}

void swingid_unpack_clear(swingid_clear *frame, const uint8_t *payload) {
    frame->session = get_u16(payload + 0);
}

void swingid_pack_who(uint8_t *payload, const swingid_who *frame) {
    for (int i = 0; i < 4; i++) payload[i] = 0;
    put_u32(payload + 0, frame->schema);
}

void swingid_unpack_who(swingid_who *frame, const uint8_t *payload) {
    frame->schema = get_u32(payload + 0);
}

void swingid_pack_hello(uint8_t *payload, const swingid_hello *frame) {
    for (int i = 0; i < 32; i++) payload[i] = 0;
    put_u32(payload + 0, frame->schema);
    put_u32(payload + 4, frame->firmware);
    put_u16(payload + 8, frame->version);
    put_u8(payload + 10, frame->state);
    put_u8(payload + 11, frame->fault);
    put_f32(payload + 12, frame->rate);
    put_u32(payload + 16, frame->axis_counts);
    put_u32(payload + 20, frame->wheel_counts);
    put_f32(payload + 24, frame->voltage_limit);
    put_u16(payload + 28, frame->parameter_room);
    put_u16(payload + 30, frame->reference_room);
}

void swingid_unpack_hello(swingid_hello *frame, const uint8_t *payload) {
    frame->schema = get_u32(payload + 0);
    frame->firmware = get_u32(payload + 4);
    frame->version = get_u16(payload + 8);
    frame->state = get_u8(payload + 10);
    frame->fault = get_u8(payload + 11);
    frame->rate = get_f32(payload + 12);
    frame->axis_counts = get_u32(payload + 16);
    frame->wheel_counts = get_u32(payload + 20);
    frame->voltage_limit = get_f32(payload + 24);
    frame->parameter_room = get_u16(payload + 28);
    frame->reference_room = get_u16(payload + 30);
}

void swingid_pack_parameters(uint8_t *payload, const swingid_parameters *frame) {
    for (int i = 0; i < 64; i++) payload[i] = 0;
    put_u16(payload + 0, frame->index);
    put_u16(payload + 2, frame->count);
    put_u16(payload + 4, frame->total);
    for (int i = 0; i < 7; i++) put_f64(payload + 8 + 8 * i, frame->value[i]);
}

void swingid_unpack_parameters(swingid_parameters *frame, const uint8_t *payload) {
    frame->index = get_u16(payload + 0);
    frame->count = get_u16(payload + 2);
    frame->total = get_u16(payload + 4);
    for (int i = 0; i < 7; i++) frame->value[i] = get_f64(payload + 8 + 8 * i);
}

void swingid_pack_reference(uint8_t *payload, const swingid_reference *frame) {
    for (int i = 0; i < 64; i++) payload[i] = 0;
    put_u32(payload + 0, frame->start);
    put_u8(payload + 4, frame->count);
    put_u8(payload + 5, frame->last);
    put_u16(payload + 6, frame->session);
    for (int i = 0; i < 14; i++) put_f32(payload + 8 + 4 * i, frame->value[i]);
}

void swingid_unpack_reference(swingid_reference *frame, const uint8_t *payload) {
    frame->start = get_u32(payload + 0);
    frame->count = get_u8(payload + 4);
    frame->last = get_u8(payload + 5);
    frame->session = get_u16(payload + 6);
    for (int i = 0; i < 14; i++) frame->value[i] = get_f32(payload + 8 + 4 * i);
}

void swingid_pack_arm(uint8_t *payload, const swingid_arm *frame) {
    for (int i = 0; i < 8; i++) payload[i] = 0;
    put_u16(payload + 0, frame->session);
    put_u8(payload + 2, frame->mode);
    put_u16(payload + 4, frame->parameters);
    put_u16(payload + 6, frame->fade);
}

void swingid_unpack_arm(swingid_arm *frame, const uint8_t *payload) {
    frame->session = get_u16(payload + 0);
    frame->mode = get_u8(payload + 2);
    frame->parameters = get_u16(payload + 4);
    frame->fade = get_u16(payload + 6);
}

void swingid_pack_run(uint8_t *payload, const swingid_run *frame) {
    for (int i = 0; i < 4; i++) payload[i] = 0;
    put_u16(payload + 0, frame->session);
}

void swingid_unpack_run(swingid_run *frame, const uint8_t *payload) {
    frame->session = get_u16(payload + 0);
}

void swingid_pack_sample(uint8_t *payload, const swingid_sample *frame) {
    for (int i = 0; i < 32; i++) payload[i] = 0;
    put_u32(payload + 0, frame->sequence);
    put_u32(payload + 4, frame->time);
    put_i32(payload + 8, frame->axis);
    put_i32(payload + 12, frame->wheel);
    put_f32(payload + 16, frame->voltage);
    put_f32(payload + 20, frame->gain);
    put_f32(payload + 24, frame->current);
    put_u16(payload + 28, frame->flags);
    put_u8(payload + 30, frame->state);
    put_u8(payload + 31, frame->fault);
}

void swingid_unpack_sample(swingid_sample *frame, const uint8_t *payload) {
    frame->sequence = get_u32(payload + 0);
    frame->time = get_u32(payload + 4);
    frame->axis = get_i32(payload + 8);
    frame->wheel = get_i32(payload + 12);
    frame->voltage = get_f32(payload + 16);
    frame->gain = get_f32(payload + 20);
    frame->current = get_f32(payload + 24);
    frame->flags = get_u16(payload + 28);
    frame->state = get_u8(payload + 30);
    frame->fault = get_u8(payload + 31);
}

void swingid_pack_ack(uint8_t *payload, const swingid_ack *frame) {
    for (int i = 0; i < 12; i++) payload[i] = 0;
    put_u16(payload + 0, frame->message);
    put_u8(payload + 2, frame->status);
    put_u8(payload + 3, frame->state);
    put_u32(payload + 4, frame->next);
    put_u32(payload + 8, frame->value);
}

void swingid_unpack_ack(swingid_ack *frame, const uint8_t *payload) {
    frame->message = get_u16(payload + 0);
    frame->status = get_u8(payload + 2);
    frame->state = get_u8(payload + 3);
    frame->next = get_u32(payload + 4);
    frame->value = get_u32(payload + 8);
}

int swingid_length_from_host(uint16_t id) {
    switch (id) {
        case SWINGID_STOP:
            return SWINGID_STOP_LENGTH;
        case SWINGID_HEARTBEAT:
            return SWINGID_HEARTBEAT_LENGTH;
        case SWINGID_CLEAR:
            return SWINGID_CLEAR_LENGTH;
        case SWINGID_WHO:
            return SWINGID_WHO_LENGTH;
        case SWINGID_PARAMETERS:
            return SWINGID_PARAMETERS_LENGTH;
        case SWINGID_REFERENCE:
            return SWINGID_REFERENCE_LENGTH;
        case SWINGID_ARM:
            return SWINGID_ARM_LENGTH;
        case SWINGID_RUN:
            return SWINGID_RUN_LENGTH;
        default:
            return -1;
    }
}
