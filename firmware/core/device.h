/* The device: frames in, one sample after the other, frames out; the same as src/swingid/live/machine.py.
 *
 * idle -> armed -> running -> stopping -> idle; a fault is latched until Clear. A board calls swingid_receive with what
 * came from the host, swingid_most_taken bytes at most, once per sample swingid_tick, applies the voltage that it
 * returns, and sends what swingid_output gives; core/loop.c does that over hal.h.
 */
#ifndef SWINGID_DEVICE_H
#define SWINGID_DEVICE_H

#include <stdint.h>

#include "frames.h"
#include "guard.h"
#include "link.h"

#define SWINGID_VERSION 1
#define SWINGID_REFERENCE_ROOM 1024 /* samples, a power of two */
#define SWINGID_OUTPUT_ROOM 1024    /* bytes */

/* Output that answers leave free for one Sample and one Fault: under a flood of requests the host still sees those. */
#define SWINGID_OUTPUT_KEPT (SWINGID_ENCODED(SWINGID_SAMPLE_LENGTH) + SWINGID_ENCODED(SWINGID_FAULT_LENGTH))

/* Bytes per second taken from the host; what comes faster waits, so that no flood keeps the device from its samples. A
 * host sends less: 12 Reference messages, a heartbeat, Run and what it repeats are 960 bytes in a turn of 5 ms, that is
 * 192 kB/s, and a line of 1 Mbaud carries 100 kB/s. A byte costs a Cortex-M3 170 instructions at worst (those of Who,
 * with the answer; tests/firmware/test_firmware_cortex.py counts them), so 34 million a second: a fifth of 168 MHz. */
#define SWINGID_MOST_TAKEN 200000

/* Bytes taken in a sample at least: the longest message, so that a fast board gets its reference. */
#define SWINGID_LEAST_TAKEN SWINGID_ENCODED(SWINGID_MOST_PAYLOAD)

typedef struct {
    swingid_config config;
    swingid_guard guard;
    /* link */
    uint8_t incoming[SWINGID_MOST_ENCODED];
    int incoming_size, skipping;
    int busy; /* set by who calls: the host has sent as much as one sample takes, so more may wait */
    uint8_t output[SWINGID_OUTPUT_ROOM];
    int output_size;
    uint16_t flags; /* to be reported by the next sample */
    uint32_t quiet; /* samples since the last frame of a host */
    /* parameters */
    double parameters[SWINGID_MOST_PARAMETERS];
    uint16_t known, total, check; /* check: of the bytes of those known */
    uint8_t valid;                /* of all, once they are known: here, as a flood of Arm would ask for it too often */
    /* run */
    double controller[SWINGID_STATES];
    float reference[SWINGID_REFERENCE_ROOM];
    uint32_t next_in, next_out;
    uint32_t sequence, start;
    uint16_t session, fade, fade_left, ended;
    double last_reference, voltage;
    uint8_t state, fault, mode, complete;
} swingid_device;

void swingid_init(swingid_device *device, const swingid_config *config);

/* Bytes of the host that a device takes between two samples at most. */
int swingid_most_taken(const swingid_config *config);

/* Bytes from a serial line, in any pieces. */
void swingid_receive(swingid_device *device, const uint8_t *bytes, int size);

/* One message from a CAN bus, or one that swingid_receive has decoded. A board on a bus, too, takes a bounded number of
 * them per sample. */
void swingid_message(swingid_device *device, uint16_t id, const uint8_t *payload, int length);

/* One sample: readings in, the voltage to apply up to the next one out. */
float swingid_tick(swingid_device *device, const swingid_inputs *inputs);

/* Whether it is armed, runs or stops; else no voltage is applied, and an amplifier may be off. */
int swingid_armed(const swingid_device *device);

/* Take at most `room` bytes for the host; returns how many. */
int swingid_output(swingid_device *device, uint8_t *bytes, int room);

/* For a CAN bus in the place of a serial line: the next message for the host, its payload in SWINGID_MOST_PAYLOAD
 * bytes; returns the payload's length, -1 where there is none. A device uses this or swingid_output, not both. */
int swingid_output_message(swingid_device *device, uint16_t *id, uint8_t *payload);

/* 0 V and a latched fault, for a board that finds something wrong itself. */
void swingid_trip(swingid_device *device, uint8_t fault, double value);

#endif
