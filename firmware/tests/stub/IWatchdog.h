#pragma once
#include <stdint.h>
struct IWatchdogClass {
    void begin(uint32_t);
    void reload();
    bool isEnabled();
};
extern IWatchdogClass IWatchdog;
