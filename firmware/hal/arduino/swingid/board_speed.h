// What a board can compute and count between its samples: Arm refuses the rest. firmware/README.md, Other boards, says
// how it was counted; at 500 samples a second.
#ifndef SWINGID_BOARD_SPEED_H
#define SWINGID_BOARD_SPEED_H

// Order of a controller that a sample has the time for, with a host that sends as much as it may.
#if defined(__IMXRT1062__)  // doubles in the processor
static const int MOST_ORDER = 4;
#elif defined(ARDUINO_ARCH_RP2040)
static const int MOST_ORDER = 1;
#elif defined(__SAMD21__) || defined(__SAMD21G18A__)
#error "48 MHz without a divider: this board has no time for a controller at 500 samples a second"
#else
static const int MOST_ORDER = 2;
#endif

// Cycles of the interrupt of an edge: on a Teensy 4 its 79 instructions, 4 cycles each as its ports are slow to read,
// and 24 to begin and end; elsewhere nobody has counted, so three times of that.
#if defined(__IMXRT1062__)
static const float EDGE_CYCLES = 340.0f;
#else
static const float EDGE_CYCLES = 1020.0f;
#endif

// Edges a second: two of one track may follow within half of their mean distance, and one that comes while the one
// before is counted is lost.
static inline float most_edges() { return (float)F_CPU / (2.0f * EDGE_CYCLES); }

#endif
