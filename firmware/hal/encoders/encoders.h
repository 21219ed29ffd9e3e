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
#define AS5048A_CLEAR_ERROR 0x4001u
#define AS5048A_READ_DIAGNOSIS 0x7FFDu
#define AS5048A_ERROR 0x4000u /* in an answer; stays until AS5048A_CLEAR_ERROR */
#define AS5048A_BITS 14

static inline int as5048a_parity(uint16_t answer) {
    unsigned ones = answer;
    ones ^= ones >> 8;
    ones ^= ones >> 4;
    ones ^= ones >> 2;
    ones ^= ones >> 1;
    return (ones & 1u) == 0;
}

/* The angle in an answer; 0 where its parity is wrong or the sensor reports an error. */
static inline int as5048a_angle(uint16_t answer, uint16_t *angle) {
    *angle = answer & 0x3FFFu;
    return as5048a_parity(answer) && (answer & AS5048A_ERROR) == 0;
}

/* Whether a diagnosis lets the angle be used: the sensor's offsets are compensated (bit 8, so no answer of all zeros
 * is one), its CORDIC is in range (9), the magnet neither too strong (10) nor too weak (11). */
static inline int as5048a_healthy(uint16_t answer) {
    return as5048a_parity(answer) && (answer & (AS5048A_ERROR | 0x0F00u)) == 0x0100u;
}

/* AMT103 and other encoders with two tracks: counts (-1, 0, 1) from the last states of A and B (bit 1, bit 0) to these,
 * all four edges of a pulse counted; 0 for two edges at once, of which nobody knows the direction. */
static inline int quadrature_step(unsigned before, unsigned now) {
    static const signed char steps[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};
    return steps[(before & 3u) << 2 | (now & 3u)];
}

#endif
