/* Frames on a serial line: COBS of (identifier, payload, CRC-16/IBM-3740), ended by a zero byte. */
#ifndef SWINGID_LINK_H
#define SWINGID_LINK_H

#include <stdint.h>

#include "frames.h"

/* Identifier, payload, check, and COBS's own byte; without the zero at the end. */
#define SWINGID_MOST_ENCODED (2 + SWINGID_MOST_PAYLOAD + 2 + 1)

/* Bytes of an encoded message, the zero at its end with them: COBS adds one byte to fewer than 254. */
#define SWINGID_ENCODED(length) ((length) + 6)

/* The check of `size` more bytes; start with 0xFFFF. */
uint16_t swingid_crc(uint16_t crc, const uint8_t *bytes, int size);

/* Encode a message with the zero at its end into SWINGID_MOST_ENCODED + 1 bytes; returns how many it has. */
int swingid_encode(uint8_t *encoded, uint16_t id, const uint8_t *payload, int length);

/* Identifier, payload and its length out of the bytes between two zeros; 0 for what is no frame. */
int swingid_decode(const uint8_t *encoded, int size, uint16_t *id, uint8_t *payload, int *length);

#endif
