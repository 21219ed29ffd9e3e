#include "link.h"

/* Four bits at a time: a fourth of the time of single bits, which a flood of frames would take from the samples. */
uint16_t swingid_crc(uint16_t crc, const uint8_t *bytes, int size) {
    static const uint16_t table[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
                                       0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
    for (int i = 0; i < size; i++) {
        crc = (uint16_t)((uint16_t)(crc << 4) ^ table[crc >> 12 ^ bytes[i] >> 4]);
        crc = (uint16_t)((uint16_t)(crc << 4) ^ table[crc >> 12 ^ (bytes[i] & 15)]);
    }
    return crc;
}

int swingid_encode(uint8_t *encoded, uint16_t id, const uint8_t *payload, int length) {
    uint8_t body[2 + SWINGID_MOST_PAYLOAD + 2];
    int code = 0, out = 1;
    uint16_t crc;
    body[0] = (uint8_t)id;
    body[1] = (uint8_t)(id >> 8);
    for (int i = 0; i < length; i++) body[2 + i] = payload[i];
    crc = swingid_crc(0xFFFF, body, length + 2);
    body[length + 2] = (uint8_t)crc;
    body[length + 3] = (uint8_t)(crc >> 8);
    for (int i = 0; i < length + 4; i++) { /* fewer than 254 bytes, so no block ends but at a zero */
        if (body[i] != 0) {
            encoded[out++] = body[i];
        } else {
            encoded[code] = (uint8_t)(out - code);
            code = out++;
        }
    }
    encoded[code] = (uint8_t)(out - code);
    encoded[out++] = 0;
    return out;
}

int swingid_decode(const uint8_t *encoded, int size, uint16_t *id, uint8_t *payload, int *length) {
    uint8_t body[SWINGID_MOST_ENCODED];
    int count = 0, next = 0;
    if (size > SWINGID_MOST_ENCODED) return 0;
    while (next < size) {
        const int code = encoded[next], end = next + code;
        if (code == 0 || end > size) return 0;
        for (next++; next < end; next++) body[count++] = encoded[next];
        if (next < size) body[count++] = 0; /* size is below 254: no code of 255 */
    }
    if (count < 4 || count > 4 + SWINGID_MOST_PAYLOAD) return 0;
    if (swingid_crc(0xFFFF, body, count - 2) != (uint16_t)(body[count - 2] | body[count - 1] << 8)) return 0;
    *id = (uint16_t)(body[0] | body[1] << 8);
    *length = count - 4;
    for (int i = 0; i < count - 4; i++) payload[i] = body[2 + i];
    return 1;
}
