#include "device.h"

#define IDLE SWINGID_STATE_IDLE
#define ARMED SWINGID_STATE_ARMED
#define RUNNING SWINGID_STATE_RUNNING
#define STOPPING SWINGID_STATE_STOPPING
#define FAULT SWINGID_STATE_FAULT

#define COUNT_OF(array) ((int)(sizeof(array) / sizeof((array)[0])))

int swingid_armed(const swingid_device *device) {
    return device->state == ARMED || device->state == RUNNING || device->state == STOPPING;
}

/* A frame for the host; one that has no room left is dropped whole and reported by a flag. */
static void send(swingid_device *device, uint16_t id, const uint8_t *payload, int length) {
    const int kept = id == SWINGID_SAMPLE || id == SWINGID_FAULT ? 0 : SWINGID_OUTPUT_KEPT;
    if (device->output_size + SWINGID_ENCODED(length) > SWINGID_OUTPUT_ROOM - kept) {
        device->flags |= SWINGID_FLAG_DROPPED;
        return;
    }
    device->output_size += swingid_encode(device->output + device->output_size, id, payload, length);
}

static void answer(swingid_device *device, uint16_t message, uint8_t status, uint32_t next, uint32_t value) {
    uint8_t payload[SWINGID_ACK_LENGTH];
    swingid_ack frame;
    frame.message = message;
    frame.status = status;
    frame.state = device->state;
    frame.next = next;
    frame.value = value;
    swingid_pack_ack(payload, &frame);
    send(device, SWINGID_ACK, payload, SWINGID_ACK_LENGTH);
}

/* Parameters of a controller of the highest order: so a host knows before a run what the board cannot do. */
static uint16_t parameter_room(const swingid_device *device) {
    const int unused = 2 * (SWINGID_MOST_ORDER - device->config.most_order);
    return (uint16_t)(SWINGID_MOST_PARAMETERS - unused);
}

int swingid_most_taken(const swingid_config *config) {
    const int most = (int)(SWINGID_MOST_TAKEN / (double)config->rate);
    return most > SWINGID_LEAST_TAKEN ? most : SWINGID_LEAST_TAKEN;
}

void swingid_init(swingid_device *device, const swingid_config *config) {
    device->config = *config;
    swingid_guard_init(&device->guard, config);
    device->incoming_size = device->skipping = device->output_size = device->busy = 0;
    device->flags = device->known = device->total = device->session = 0;
    device->check = 0xFFFF;
    device->valid = 0;
    device->fade = device->fade_left = device->ended = 0;
    device->quiet = (uint32_t)config->rate + 1;
    device->next_in = device->next_out = device->sequence = device->start = 0;
    device->last_reference = device->voltage = 0.0;
    device->state = IDLE;
    device->fault = SWINGID_FAULTCODE_NONE;
    device->mode = device->complete = 0;
    for (int i = 0; i < SWINGID_STATES; i++) device->controller[i] = 0.0;
    for (int i = 0; i < SWINGID_MOST_PARAMETERS; i++) device->parameters[i] = 0.0;
}

void swingid_trip(swingid_device *device, uint8_t fault, double value) {
    uint8_t payload[SWINGID_FAULT_LENGTH];
    swingid_fault frame;
    device->state = FAULT;
    device->fault = fault;
    frame.sequence = device->sequence;
    frame.time = device->guard.time;
    frame.code = fault;
    frame.state = device->state;
    frame.value = (float)value;
    swingid_pack_fault(payload, &frame);
    send(device, SWINGID_FAULT, payload, SWINGID_FAULT_LENGTH);
}

static double rest(const swingid_device *device) {
    return device->mode == SWINGID_MODE_OPEN_LOOP ? 0.0 : device->parameters[SWINGID_REST];
}

static void begin_fade(swingid_device *device) {
    device->state = STOPPING;
    device->fade_left = device->fade;
}

/* ---- messages of the host ---- */

static void on_who(swingid_device *device) {
    uint8_t payload[SWINGID_HELLO_LENGTH];
    swingid_hello frame;
    frame.schema = SWINGID_SCHEMA;
    frame.firmware = device->config.firmware;
    frame.version = SWINGID_VERSION;
    frame.state = device->state;
    frame.fault = device->fault;
    frame.rate = device->config.rate;
    frame.axis_counts = device->config.axis_counts;
    frame.wheel_counts = device->config.wheel_counts;
    frame.voltage_limit = device->config.voltage_limit;
    frame.parameter_room = parameter_room(device);
    frame.reference_room = SWINGID_REFERENCE_ROOM;
    swingid_pack_hello(payload, &frame);
    send(device, SWINGID_HELLO, payload, SWINGID_HELLO_LENGTH);
}

static void on_heartbeat(swingid_device *device, const uint8_t *payload) {
    swingid_heartbeat frame;
    swingid_unpack_heartbeat(&frame, payload);
    if (frame.session == device->session) device->guard.fresh = 1;
}

static void on_stop(swingid_device *device, const uint8_t *payload) {
    swingid_stop frame;
    swingid_unpack_stop(&frame, payload);
    if (device->state == FAULT) {
        answer(device, SWINGID_STOP, SWINGID_STATUS_WRONG_STATE, 0, 0);
        return;
    }
    if (frame.mode != SWINGID_STOPMODE_SOFT || device->state == ARMED) {
        device->state = IDLE;
    } else if (device->state == RUNNING) {
        begin_fade(device);
    }
    answer(device, SWINGID_STOP, SWINGID_STATUS_DONE, 0, 0);
}

static void on_clear(swingid_device *device) {
    const int latched = device->state == FAULT;
    if (latched) {
        device->state = IDLE;
        device->fault = SWINGID_FAULTCODE_NONE;
    }
    answer(device, SWINGID_CLEAR, latched ? SWINGID_STATUS_DONE : SWINGID_STATUS_WRONG_STATE, 0, 0);
}

static uint8_t take_parameters(swingid_device *device, const swingid_parameters *frame) {
    if (device->state != IDLE) return SWINGID_STATUS_WRONG_STATE;
    if (frame->count < 1 || frame->count > COUNT_OF(frame->value) || frame->total > parameter_room(device) ||
        frame->index + frame->count > frame->total) {
        return SWINGID_STATUS_BAD_VALUE;
    }
    if (frame->index == 0) {
        device->known = 0;
        device->check = 0xFFFF;
        device->total = frame->total;
    }
    if (frame->index != device->known || frame->total != device->total) return SWINGID_STATUS_GAP;
    for (int i = 0; i < frame->count; i++) {
        uint8_t bytes[8];
        device->parameters[device->known++] = frame->value[i];
        swingid_put_f64(bytes, frame->value[i]);
        device->check = swingid_crc(device->check, bytes, 8);
    }
    if (device->known == device->total) {
        device->valid = (uint8_t)swingid_parameters_valid(device->parameters, device->known, &device->config);
    }
    return SWINGID_STATUS_DONE;
}

static void on_parameters(swingid_device *device, const uint8_t *payload) {
    swingid_parameters frame;
    uint8_t status;
    swingid_unpack_parameters(&frame, payload);
    status = take_parameters(device, &frame);
    answer(device, SWINGID_PARAMETERS, status, device->known, device->check);
}

static uint8_t arm(swingid_device *device, const swingid_arm *frame) {
    if ((device->state != IDLE && device->state != ARMED) || !device->guard.seen) return SWINGID_STATUS_WRONG_STATE;
    if (frame->mode > SWINGID_MODE_OPEN_LOOP) return SWINGID_STATUS_BAD_VALUE;
    if (device->total == 0 || device->known != device->total) return SWINGID_STATUS_NO_PARAMETERS;
    if (frame->parameters != device->check || !device->valid) return SWINGID_STATUS_BAD_PARAMETERS;
    if (device->parameters[SWINGID_VOLTAGE_LIMIT] > (double)device->config.voltage_limit) {
        return SWINGID_STATUS_OVER_LIMIT;
    }
    if (!swingid_guard_counts(device->parameters, &device->config)) return SWINGID_STATUS_TOO_FAST;
    for (int i = 0; i < SWINGID_STATES; i++) device->controller[i] = 0.0;
    device->controller[SWINGID_K_TILDE] = device->parameters[SWINGID_START_GAIN];
    device->session = frame->session;
    device->mode = frame->mode;
    device->fade = frame->fade;
    device->next_in = device->next_out = 0;
    device->complete = 0;
    device->ended = 0;
    device->last_reference = rest(device);
    swingid_guard_arm(&device->guard);
    device->state = ARMED;
    return SWINGID_STATUS_DONE;
}

static void on_arm(swingid_device *device, const uint8_t *payload) {
    swingid_arm frame;
    uint8_t status;
    swingid_unpack_arm(&frame, payload);
    status = arm(device, &frame);
    answer(device, SWINGID_ARM, status, device->next_in, SWINGID_REFERENCE_ROOM);
}

static uint32_t room(const swingid_device *device) {
    return SWINGID_REFERENCE_ROOM - (device->next_in - device->next_out);
}

static uint8_t take_reference(swingid_device *device, const swingid_reference *frame) {
    if (device->state != ARMED && device->state != RUNNING) return SWINGID_STATUS_WRONG_STATE;
    if (frame->session != device->session) return SWINGID_STATUS_WRONG_SESSION;
    if (frame->count > COUNT_OF(frame->value)) return SWINGID_STATUS_BAD_VALUE;
    if (frame->start != device->next_in) return SWINGID_STATUS_GAP;
    if (device->complete) return SWINGID_STATUS_BAD_VALUE;
    if (frame->count > room(device)) return SWINGID_STATUS_FULL;
    for (int i = 0; i < frame->count; i++) {
        if (frame->value[i] - frame->value[i] != 0.0f) return SWINGID_STATUS_BAD_VALUE; /* not finite */
    }
    for (int i = 0; i < frame->count; i++) {
        device->reference[device->next_in++ % SWINGID_REFERENCE_ROOM] = frame->value[i];
    }
    device->complete = frame->last != 0;
    return SWINGID_STATUS_DONE;
}

static void on_reference(swingid_device *device, const uint8_t *payload) {
    swingid_reference frame;
    uint8_t status;
    swingid_unpack_reference(&frame, payload);
    status = take_reference(device, &frame);
    answer(device, SWINGID_REFERENCE, status, device->next_in, room(device));
}

static void on_run(swingid_device *device, const uint8_t *payload) {
    uint8_t status = SWINGID_STATUS_DONE;
    swingid_run frame;
    swingid_unpack_run(&frame, payload);
    if (device->state != ARMED && device->state != RUNNING) {
        status = SWINGID_STATUS_WRONG_STATE;
    } else if (frame.session != device->session) {
        status = SWINGID_STATUS_WRONG_SESSION;
    } else if (device->state == ARMED && device->next_in == 0) {
        status = SWINGID_STATUS_NO_REFERENCE;
    } else if (device->state == ARMED) {
        device->state = RUNNING;
        device->start = device->sequence;
    }
    answer(device, SWINGID_RUN, status, device->next_in, device->start);
}

void swingid_message(swingid_device *device, uint16_t id, const uint8_t *payload, int length) {
    if (swingid_length_from_host(id) != length) {
        device->flags |= SWINGID_FLAG_BAD_FRAME;
        return;
    }
    device->quiet = 0;
    if (id == SWINGID_WHO) on_who(device);
    if (id == SWINGID_HEARTBEAT) on_heartbeat(device, payload);
    if (id == SWINGID_STOP) on_stop(device, payload);
    if (id == SWINGID_CLEAR) on_clear(device);
    if (id == SWINGID_PARAMETERS) on_parameters(device, payload);
    if (id == SWINGID_ARM) on_arm(device, payload);
    if (id == SWINGID_REFERENCE) on_reference(device, payload);
    if (id == SWINGID_RUN) on_run(device, payload);
}

static void end_of_frame(swingid_device *device) {
    uint8_t payload[SWINGID_MOST_PAYLOAD];
    uint16_t id;
    int length;
    if (device->skipping) {
        device->flags |= SWINGID_FLAG_BAD_FRAME;
    } else if (device->incoming_size > 0) {
        if (swingid_decode(device->incoming, device->incoming_size, &id, payload, &length)) {
            swingid_message(device, id, payload, length);
        } else {
            device->flags |= SWINGID_FLAG_BAD_FRAME;
        }
    }
    device->incoming_size = device->skipping = 0;
}

void swingid_receive(swingid_device *device, const uint8_t *bytes, int size) {
    for (int i = 0; i < size; i++) {
        if (bytes[i] == 0) {
            end_of_frame(device);
        } else if (device->incoming_size == SWINGID_MOST_ENCODED) {
            device->skipping = 1;
        } else {
            device->incoming[device->incoming_size++] = bytes[i];
        }
    }
}

static void remove_output(swingid_device *device, int count) {
    for (int i = count; i < device->output_size; i++) device->output[i - count] = device->output[i];
    device->output_size -= count;
}

int swingid_output(swingid_device *device, uint8_t *bytes, int room_for) {
    const int count = room_for < device->output_size ? room_for : device->output_size;
    for (int i = 0; i < count; i++) bytes[i] = device->output[i];
    remove_output(device, count);
    return count;
}

int swingid_output_message(swingid_device *device, uint16_t *id, uint8_t *payload) {
    int size = 0, length;
    if (device->output_size == 0) return -1;
    while (size < device->output_size - 1 && device->output[size] != 0) size++; /* a frame ends with a zero */
    if (!swingid_decode(device->output, size, id, payload, &length)) length = -1;
    remove_output(device, size + 1);
    return length;
}

/* ---- one sample ---- */

/* The reference of this sample; moves on in the run and in its fading end. 0: the run is over. */
static int next_reference(swingid_device *device, double *reference) {
    if (device->state == RUNNING) {
        if (device->next_out != device->next_in) {
            device->last_reference = (double)device->reference[device->next_out++ % SWINGID_REFERENCE_ROOM];
            *reference = device->last_reference;
            return 1;
        }
        device->ended |= device->complete ? SWINGID_FLAG_FINISHED : SWINGID_FLAG_STARVED;
        begin_fade(device);
    }
    if (device->fade_left == 0) return 0;
    device->fade_left--;
    *reference = rest(device) + (device->last_reference - rest(device)) * device->fade_left / device->fade;
    return 1;
}

/* Voltage (V) of this sample in the controller's sign. */
static double command(swingid_device *device) {
    const double *p = device->parameters;
    double reference, value, angle, voltage;
    int fault, clamped;
    if (!next_reference(device, &reference)) {
        device->state = IDLE;
        return 0.0;
    }
    voltage = reference;
    if (device->mode == SWINGID_MODE_CLOSED_LOOP) {
        angle = (double)(device->guard.axis - (int64_t)p[SWINGID_AXIS_ZERO]) * p[SWINGID_AXIS_STEP];
        voltage = swingid_compensator_step(reference, angle, (double)device->guard.wheel * p[SWINGID_WHEEL_STEP],
                                           device->controller, p + SWINGID_CONTROLLER);
    }
    fault = swingid_guard_voltage(&device->guard, &device->config, p, &voltage, &clamped, &value);
    if (clamped) device->flags |= SWINGID_FLAG_CLAMPED;
    if (fault != SWINGID_FAULTCODE_NONE) {
        swingid_trip(device, (uint8_t)fault, value);
        return 0.0;
    }
    return voltage * p[SWINGID_VOLTAGE_SIGN];
}

static void send_sample(swingid_device *device, const swingid_inputs *inputs) {
    uint8_t payload[SWINGID_SAMPLE_LENGTH];
    swingid_sample frame;
    frame.sequence = device->sequence;
    frame.time = inputs->time;
    frame.axis = inputs->axis;
    frame.wheel = inputs->wheel;
    frame.voltage = (float)device->voltage;
    frame.gain = (float)device->controller[SWINGID_K_TILDE];
    frame.current = inputs->current;
    frame.flags = (uint16_t)(device->flags | device->ended);
    if (device->state == STOPPING) frame.flags |= SWINGID_FLAG_FADING;
    frame.state = device->state;
    frame.fault = device->fault;
    swingid_pack_sample(payload, &frame);
    device->flags = 0;
    send(device, SWINGID_SAMPLE, payload, SWINGID_SAMPLE_LENGTH);
}

float swingid_tick(swingid_device *device, const swingid_inputs *inputs) {
    double voltage = 0.0, value;
    swingid_guard_track(&device->guard, inputs, device->busy);
    if (!inputs->valid) device->flags |= SWINGID_FLAG_INVALID;
    if (device->guard.late) device->flags |= SWINGID_FLAG_LATE;
    if (swingid_armed(device)) {
        const int fault =
            swingid_guard_check(&device->guard, inputs, device->parameters, device->voltage, &value);
        if (fault != SWINGID_FAULTCODE_NONE) swingid_trip(device, (uint8_t)fault, value);
    }
    if (device->state == RUNNING || device->state == STOPPING) voltage = command(device);
    device->voltage = (double)(float)voltage;
    if (swingid_armed(device) || device->quiet <= (uint32_t)device->config.rate) send_sample(device, inputs);
    if (device->quiet <= (uint32_t)device->config.rate) device->quiet++;
    device->sequence++;
    return (float)device->voltage;
}
