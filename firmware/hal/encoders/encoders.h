/* From what an encoder sends to counts over many turns. */
#ifndef SWINGID_ENCODERS_H
#define SWINGID_ENCODERS_H

#include <stdint.h>

/* `total` moved on to the count nearest to it whose last `bits` bits (31 at most) are those of `raw`: the turns of an
 * absolute encoder, or the overflows of a short counter, if it moves by less than half its range between two calls. */
static inline int32_t swingid_extend(int32_t total, uint32_t raw, int bits) {
    const uint32_t range = (uint32_t)1 << bits, change = (raw - (uint32_t)total) & (range - 1);
    return (int32_t)((uint32_t)total + change - (change >= range / 2 ? range : 0));
}

/* AS5048A (14 bits, SPI mode 1, 10 MHz at most): what to send to read the angle; the answer comes with the next frame.
 * ams AS5048 data sheet, SPI interface: bit 15 even parity, bit 14 read in a command and error in an answer. */
#define AS5048A_READ_ANGLE 0xFFFFu
#define AS5048A_BITS 14

/* The angle in an answer; 0 where its parity is wrong or the sensor reports an error. */
static inline int as5048a_angle(uint16_t answer, uint16_t *angle) {
    unsigned ones = answer;
    ones ^= ones >> 8;
    ones ^= ones >> 4;
    ones ^= ones >> 2;
    ones ^= ones >> 1;
    *angle = answer & 0x3FFFu;
    return (ones & 1u) == 0 && (answer & 0x4000u) == 0;
}

/* AMT103 and other encoders with two tracks: counts (-1, 0, 1) from the last states of A and B (bit 1, bit 0) to these,
 * all four edges of a pulse counted; 0 for two edges at once, of which nobody knows the direction. */
static inline int quadrature_step(unsigned before, unsigned now) {
    static const signed char steps[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};
    return steps[(before & 3u) << 2 | (now & 3u)];
}

#endif
