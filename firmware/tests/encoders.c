/* The inline functions of encoders.h for Python. */
#include "encoders.h"

int32_t extend(int32_t total, uint32_t raw, int bits) { return swingid_extend(total, raw, bits); }
int angle(uint16_t answer, uint16_t *found) { return as5048a_angle(answer, found); }
int step(unsigned before, unsigned now) { return quadrature_step(before, now); }
