#pragma once
#include <stdint.h>
struct SPISettings {
    SPISettings(uint32_t, int, int);
};
struct SPIPort {
    void begin();
    void beginTransaction(SPISettings);
    uint16_t transfer16(uint16_t);
    void endTransaction();
};
extern SPIPort SPI;
