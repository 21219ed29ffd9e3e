/* What a board must have; core/loop.c is the rest. All are called from the loop alone, none may wait but hal_wait: a
 * board that waits for its host, to send or to receive, holds its last voltage meanwhile. */
#ifndef SWINGID_HAL_H
#define SWINGID_HAL_H

#include "device.h"

/* Wait until the next sample is due; 0 ends the loop (a process that is told to stop; never on a board). The one place
 * that feeds a watchdog. */
int hal_wait(void);

/* Encoders, current and time of this sample. An encoder that gives no reading: its last one, and valid = 0. */
void hal_read(swingid_inputs *inputs);

/* Hold this voltage from now on. 0 must be safe: the amplifier's brake or free running. armed: 0 from the reset until
 * Arm and after each run, where an amplifier with an enable lets go of the motor. */
void hal_apply(float voltage, int armed);

/* Take what has come from the host, at most `room` bytes; 0 where there is nothing more. The loop takes up to
 * swingid_most_taken bytes before a sample, however many calls that needs. */
int hal_receive(uint8_t *bytes, int room);

/* Pass bytes on to the host; returns how many were accepted. */
int hal_send(const uint8_t *bytes, int size);

/* The loop: never returns on a board. */
void swingid_loop(const swingid_config *config);

#endif
