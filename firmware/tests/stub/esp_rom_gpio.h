#pragma once
#include <stdint.h>
extern "C" void esp_rom_gpio_connect_out_signal(uint32_t, uint32_t, bool, bool);
