#pragma once
#include <stdint.h>
extern "C" void watchdog_enable(uint32_t, bool);
extern "C" void watchdog_update();
