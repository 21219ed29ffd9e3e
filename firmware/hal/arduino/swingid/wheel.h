// The wheel's two tracks, counted by interrupts: one for each edge of both.
#ifndef SWINGID_WHEEL_H
#define SWINGID_WHEEL_H

#include "encoders.h"

static volatile int32_t wheel;
static volatile unsigned char wheel_pins;

static unsigned char read_wheel_pins() {
    return (unsigned char)(digitalRead(WHEEL_A) << 1 | digitalRead(WHEEL_B));
}

static void on_wheel_edge() {
    const unsigned char now = read_wheel_pins();
    wheel = wheel + quadrature_step(wheel_pins, now);
    wheel_pins = now;
}

static void wheel_start() {
    pinMode(WHEEL_A, INPUT_PULLUP);
    pinMode(WHEEL_B, INPUT_PULLUP);
    wheel_pins = read_wheel_pins();
    attachInterrupt(digitalPinToInterrupt(WHEEL_A), on_wheel_edge, CHANGE);
    attachInterrupt(digitalPinToInterrupt(WHEEL_B), on_wheel_edge, CHANGE);
}

#endif
