/* The loop over a board of a script, which floods it, starves it and is late: what core/loop.c promises to every board,
 * checked at each call. Made with -fsanitize=address,undefined.
 *
 *     fuzz_loop SEED RUNS SAMPLES
 *
 * Between two samples it takes swingid_most_taken bytes at most and calls the board a bounded number of times; the
 * voltage is 0 but in a run, never beyond the limit, 0 once a fault is latched until Clear, and 0 within 100 ms of
 * device time after the last heartbeat was sent, however long that waited; what goes to the host are whole frames that
 * say the voltage applied, and where it takes all of them none is missing of a sample or a fault.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "loop.c" /* its device is looked into */

#define SESSION 7
#define REMEMBERED 65536 /* samples */
#define QUEUE (1 << 20)
#define PARAMETERS (SWINGID_CONTROLLER + SWINGID_ALPHA + 1)

enum { SILENT, PROPER, NOISY, GARBAGE, WHO, HEARTBEATS, REFERENCES, MIXED, BEHAVIOURS };

static swingid_config board;
static unsigned long long random_state;
static unsigned long samples, wanted_samples, driven, flooded, flooded_driven, tripped;

/* ---- the host: bytes that wait, and which of them end a frame of interest ---- */
static uint8_t queue[QUEUE];
static uint8_t ends[QUEUE]; /* 1 heartbeat, 2 Arm, 4 Clear, 8 Stop: the frame that ends with this byte */
static unsigned long in, out;
static int behaviour, left, takes_all;

/* ---- what has been seen ---- */
static unsigned long empty_at;    /* sample before which the queue was last found empty */
static unsigned long born;        /* sample before which what now waits came at the earliest */
static unsigned long heartbeat;   /* sample from which the last heartbeat counts */
static uint32_t times[REMEMBERED];
static float voltages[REMEMBERED];
static uint32_t now;
static float applied;
static int taken, calls, applies, energised, latched, fault_now, cleared, stopped, heard;
static int16_t valid_for, axis_counts;
static uint8_t host_bytes[256];
static int host_size;
static long host_sequence, fault_sequence;
static unsigned long takes_since; /* sample from which the host takes all */

static unsigned draw(unsigned below) {
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (unsigned)((random_state >> 16) % below);
}

static void broken(const char *what) {
    printf("sample %lu, state %d, behaviour %d, %g V: %s\n", samples, device.state, behaviour, (double)applied, what);
    exit(1);
}

static void put(const uint8_t *bytes, int size, uint8_t kind) {
    for (int i = 0; i < size; i++) {
        queue[in % QUEUE] = bytes[i];
        ends[in++ % QUEUE] = i == size - 1 ? kind : 0;
    }
}

static void say(uint16_t id, const uint8_t *payload, int length, uint8_t kind) {
    uint8_t encoded[SWINGID_MOST_ENCODED + 1];
    const int size = swingid_encode(encoded, id, payload, length);
    if (behaviour == MIXED && draw(8) == 0) { /* damaged on the way */
        encoded[draw((unsigned)size)] ^= (uint8_t)(1 << draw(8));
        kind = 0;
    }
    put(encoded, size, kind);
}

static void say_parameters(void) {
    static double p[PARAMETERS];
    uint8_t payload[64];
    double *c = p + SWINGID_CONTROLLER;
    swingid_parameters frame;
    swingid_arm arming = {SESSION, 0, 0xFFFF, 0};
    for (int i = 0; i < PARAMETERS; i++) p[i] = 0.0;
    p[SWINGID_AXIS_STEP] = p[SWINGID_WHEEL_STEP] = 6.283185307179586 / 16384;
    p[SWINGID_VOLTAGE_SIGN] = draw(2) ? 1.0 : -1.0;
    p[SWINGID_ANGLE_LIMIT] = 1.5;
    p[SWINGID_SPEED_LIMIT] = p[SWINGID_WHEEL_SPEED_LIMIT] = 1e6;
    p[SWINGID_VOLTAGE_LIMIT] = draw(4) ? 10.0 : 0.1 * (1 + draw(100));
    p[SWINGID_CURRENT_LIMIT] = p[SWINGID_AXIS_JUMP] = p[SWINGID_WHEEL_JUMP] = 1e3;
    p[SWINGID_FROZEN_SAMPLES] = p[SWINGID_SATURATED_SAMPLES] = draw(4) ? 60000.0 : 300.0;
    p[SWINGID_SPEED_SPAN] = 20.0;
    c[SWINGID_SAMPLE_TIME] = 1.0 / (double)board.rate;
    c[SWINGID_LIMIT] = 10.0;
    c[SWINGID_K_TILDE_MAX] = 1e3;
    c[SWINGID_ERROR_DECAY] = c[SWINGID_WHEEL_DECAY] = 0.5;
    c[SWINGID_PLANT_SIGN] = c[SWINGID_ALPHA] = c[SWINGID_LAMBDA0] = p[SWINGID_START_GAIN] = 1.0 + draw(5);
    frame.total = PARAMETERS;
    for (int at = 0; at < PARAMETERS; at += 7) {
        frame.index = (uint16_t)at;
        frame.count = (uint16_t)(PARAMETERS - at < 7 ? PARAMETERS - at : 7);
        for (int i = 0; i < 7; i++) frame.value[i] = i < frame.count ? p[at + i] : 0.0;
        swingid_pack_parameters(payload, &frame);
        say(SWINGID_PARAMETERS, payload, SWINGID_PARAMETERS_LENGTH, 0);
    }
    for (int i = 0; i < PARAMETERS; i++) {
        swingid_put_f64(payload, p[i]);
        arming.parameters = swingid_crc(arming.parameters, payload, 8);
    }
    arming.mode = (uint8_t)(draw(3) == 0 ? SWINGID_MODE_CLOSED_LOOP : SWINGID_MODE_OPEN_LOOP);
    arming.fade = (uint16_t)draw(50);
    swingid_pack_arm(payload, &arming);
    say(SWINGID_ARM, payload, SWINGID_ARM_LENGTH, 2);
}

static void say_reference(uint32_t start, int count, int last) {
    uint8_t payload[64];
    swingid_reference frame = {start, (uint8_t)count, (uint8_t)last, SESSION, {0}};
    for (int i = 0; i < 14; i++) frame.value[i] = (float)((double)draw(2400) * 0.01 - 12.0);
    if (draw(200) == 0) frame.value[draw(14)] = 1e30f;
    swingid_pack_reference(payload, &frame);
    say(SWINGID_REFERENCE, payload, SWINGID_REFERENCE_LENGTH, 0);
}

/* A message of two numbers of 16 bits, as Heartbeat, Run, Stop, Clear and Who are. */
static void say_short(uint16_t id, uint16_t one, uint16_t other, uint8_t kind) {
    const uint8_t payload[4] = {(uint8_t)one, (uint8_t)(one >> 8), (uint8_t)other, (uint8_t)(other >> 8)};
    say(id, payload, 4, kind);
}

static void say_garbage(void) {
    uint8_t bytes[200];
    const unsigned size = 1 + draw(sizeof bytes);
    for (unsigned i = 0; i < size; i++) bytes[i] = (uint8_t)(draw(40) ? draw(256) : 0);
    put(bytes, (int)size, 0);
}

static void say_anything(void) {
    const unsigned kind = draw(12);
    if (kind == 0) say_garbage();
    if (kind == 1) say_parameters();
    if (kind == 2) say_short(SWINGID_STOP, SESSION, (uint16_t)draw(3), 8);
    if (kind == 3) say_short(SWINGID_CLEAR, SESSION, 0, 4);
    if (kind == 4 || kind == 5) say_short(SWINGID_RUN, SESSION, 0, 0);
    if (kind == 6) say_short(SWINGID_WHO, 0, 0, 0);
    if (kind == 7) say_short(SWINGID_HEARTBEAT, SESSION + 1, 0, 0);
    if (kind == 8) say_short(SWINGID_HEARTBEAT, SESSION, 0, 1);
    if (kind > 8) say_reference(draw(2) ? device.next_in : draw(2000), (int)draw(17), draw(20) == 0);
}

/* What a host does that follows the device: this much before each sample. */
static void say_proper(void) {
    if (device.state == SWINGID_STATE_FAULT) say_short(SWINGID_CLEAR, SESSION, 0, 4);
    if (device.state == SWINGID_STATE_IDLE) say_parameters();
    if (device.state == SWINGID_STATE_ARMED || device.state == SWINGID_STATE_RUNNING) {
        const unsigned ahead = device.next_in - device.next_out;
        if (ahead < 500) {
            for (uint32_t i = 0; i < 3; i++) say_reference(device.next_in + 14 * i, 14, 0);
        }
        if (device.state == SWINGID_STATE_ARMED && device.next_in > 0) say_short(SWINGID_RUN, SESSION, 0, 0);
        if (draw((unsigned)board.rate / 50 + 1) == 0) say_short(SWINGID_HEARTBEAT, SESSION, 0, 1);
    }
}

static void say_flood(void) {
    switch (behaviour) {
        case GARBAGE:
            say_garbage();
            break;
        case WHO:
            say_short(SWINGID_WHO, 0, 0, 0);
            break;
        case HEARTBEATS:
            say_short(SWINGID_HEARTBEAT, SESSION, 0, 1);
            break;
        case REFERENCES:
            say_reference(device.next_in, 14, 0);
            say_short(SWINGID_RUN, SESSION, 0, 0);
            break;
        default:
            say_anything();
    }
}

static int floods(void) { return behaviour >= GARBAGE; }

/* ---- the board ---- */

static void delivered(uint8_t kind) {
    const int may_arm = device.state == SWINGID_STATE_IDLE || device.state == SWINGID_STATE_ARMED || stopped;
    if (kind & 1) heard = 1;
    if (kind & 2 && may_arm) heard = 1;
    if (kind & 4) cleared = 1;
    if (kind & 8) stopped = 1;
}

int hal_receive(uint8_t *bytes, int room) {
    int count = 0;
    if (++calls > swingid_most_taken(&board) + 4) broken("the board is called without end between two samples");
    if (room < 1) broken("no room");
    while (floods() && in - out < (unsigned long)room) say_flood();
    if (in == out) {
        empty_at = samples;
        return 0;
    }
    if (draw(3) == 0) room = 1 + (int)draw((unsigned)room); /* in pieces */
    while (count < room && out != in) {
        delivered(ends[out % QUEUE]);
        bytes[count++] = queue[out++ % QUEUE];
    }
    taken += count;
    if (taken > swingid_most_taken(&board)) broken("more bytes are taken than a sample has time for");
    return count;
}

int hal_wait(void) {
    if (samples > 0 && applies != 1) broken("the voltage is not set once per sample");
    if (takes_all && samples > takes_since + 3) { /* what had to wait before has gone */
        if (energised && host_sequence != (long)samples - 1) broken("the host does not see a sample");
        if (fault_now && fault_sequence != (long)samples - 1) broken("the host does not see a fault");
    }
    if (heard) { /* sent after the link was last empty, and no earlier than what waits came */
        const unsigned long since = empty_at == samples ? samples : born;
        if (since > heartbeat) heartbeat = since;
    }
    if (out == in && !floods()) born = samples + 1;
    flooded += (unsigned long)floods();
    taken = calls = applies = heard = stopped = 0;
    if (left-- == 0) {
        behaviour = draw(3) ? PROPER : (int)draw(BEHAVIOURS);
        left = 1 + (int)draw(behaviour == PROPER ? 600 : 250);
        if (draw(2)) {
            takes_all = !takes_all;
            takes_since = samples;
        }
        if (out == in) born = samples + 1;
    }
    if (behaviour == PROPER || behaviour == NOISY) say_proper();
    if (behaviour == NOISY && draw(4) == 0) say_anything();
    if (in - out > QUEUE / 2) out = in; /* unplugged */
    return samples < wanted_samples;
}

void hal_read(swingid_inputs *inputs) {
    static const unsigned steps[] = {100, 100, 100, 100, 100, 100, 100, 149, 51, 0};
    const unsigned kind = draw(500);
    const unsigned long long period = (unsigned long long)(1e6 / (double)board.rate);
    now += (uint32_t)(period * (kind < 10 ? steps[kind] : kind == 10 && draw(20) == 0 ? 1000 : 100) / 100);
    times[samples % REMEMBERED] = now;
    if (valid_for-- < -6 || valid_for > 400) valid_for = (int16_t)draw(400);
    axis_counts = (int16_t)(axis_counts + (int)draw(5) - 2 - axis_counts / 512);
    inputs->time = now;
    inputs->axis = axis_counts + (draw(5000) == 0 ? 2000 : 0);
    inputs->wheel = (int32_t)((uint32_t)samples * 7u + 2147483000u);
    inputs->current = draw(3) ? 0.5f : draw(1000) ? -2.0f : 1e9f;
    inputs->valid = valid_for > 0 || draw(4) > 0;
}

void hal_apply(float voltage, int armed) {
    const double *p = device.parameters;
    const int may = device.state == SWINGID_STATE_RUNNING || device.state == SWINGID_STATE_STOPPING;
    const uint32_t age = now - times[heartbeat % REMEMBERED];
    applied = voltage;
    applies++;
    if (samples >= wanted_samples) { /* the end of the loop */
        if (voltage != 0.0f) broken("a voltage after the end");
        return;
    }
    voltages[samples % REMEMBERED] = voltage;
    if (voltage - voltage != 0.0f) broken("no number");
    if (voltage != 0.0f && !may) broken("a voltage outside a run");
    if (armed != (may || device.state == SWINGID_STATE_ARMED)) broken("the amplifier is enabled wrongly");
    if (voltage > (float)p[SWINGID_VOLTAGE_LIMIT] || -voltage > (float)p[SWINGID_VOLTAGE_LIMIT]) broken("limit");
    if (voltage != 0.0f && (samples - heartbeat >= REMEMBERED || age >= SWINGID_HEARTBEAT_TIME)) {
        broken("100 ms without a heartbeat");
    }
    if (latched && !cleared && (voltage != 0.0f || device.state != SWINGID_STATE_FAULT)) broken("a fault is forgotten");
    cleared = 0;
    energised = may || device.state == SWINGID_STATE_ARMED;
    fault_now = !latched && device.state == SWINGID_STATE_FAULT;
    tripped += (unsigned long)fault_now;
    latched = device.state == SWINGID_STATE_FAULT;
    driven += (unsigned long)(voltage != 0.0f);
    flooded_driven += (unsigned long)(voltage != 0.0f && floods());
    samples++;
}

/* One frame as the host has it. */
static void read_frame(void) {
    uint8_t payload[SWINGID_MOST_PAYLOAD];
    swingid_sample frame;
    uint16_t id;
    int length;
    if (!swingid_decode(host_bytes, host_size, &id, payload, &length)) broken("the host gets no frame");
    if (id == SWINGID_FAULT) {
        swingid_fault fault;
        swingid_unpack_fault(&fault, payload);
        fault_sequence = (long)fault.sequence;
    }
    if (id != SWINGID_SAMPLE) return;
    swingid_unpack_sample(&frame, payload);
    if ((long)frame.sequence <= host_sequence) broken("samples out of order");
    host_sequence = (long)frame.sequence;
    if (frame.voltage != voltages[frame.sequence % REMEMBERED]) broken("the host is told another voltage");
}

int hal_send(const uint8_t *bytes, int size) {
    const int count = takes_all ? size : (int)draw((unsigned)size + 1);
    if (++calls > swingid_most_taken(&board) + 4) broken("the board is called without end between two samples");
    for (int i = 0; i < count; i++) {
        if (bytes[i] == 0) {
            read_frame();
            host_size = 0;
        } else {
            if (host_size == (int)sizeof host_bytes) broken("a frame without end");
            host_bytes[host_size++] = bytes[i];
        }
    }
    return count;
}

int main(int count, char **arguments) {
    static const float rates[] = {20.0f, 100.0f, 333.0f, 500.0f, 1000.0f, 1000.0f, 4000.0f, 10000.0f};
    unsigned long runs = 0, all[5] = {0};
    if (count != 4) return 2;
    random_state = 0x9E3779B97F4A7C15u ^ strtoull(arguments[1], NULL, 10) << 20;
    wanted_samples = strtoul(arguments[3], NULL, 10);
    for (; runs < strtoul(arguments[2], NULL, 10); runs++) {
        const swingid_config one = {rates[draw(8)], 16384, 16384, 10.0f, 1, SWINGID_MOST_ORDER, 0};
        board = one;
        samples = in = out = empty_at = born = heartbeat = driven = flooded = flooded_driven = tripped = 0;
        takes_since = 0;
        energised = fault_now = takes_all = 0;
        taken = calls = applies = latched = cleared = stopped = heard = left = host_size = 0;
        behaviour = PROPER;
        host_sequence = fault_sequence = -1;
        now = draw(2) ? 0xFFFFFFFFu - draw(1000000) : draw(1000000); /* the clock wraps in the run */
        axis_counts = valid_for = 0;
        swingid_loop(&board);
        all[0] += samples;
        all[1] += driven;
        all[2] += flooded;
        all[3] += flooded_driven;
        all[4] += tripped;
    }
    printf("%lu samples, %lu with a voltage, %lu flooded, %lu of these with a voltage, %lu faults\n", all[0], all[1],
           all[2], all[3], all[4]);
    return 0;
}
