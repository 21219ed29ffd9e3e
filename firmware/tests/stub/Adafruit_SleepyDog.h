#pragma once
struct WatchdogType {
    int enable(int);
    void reset();
};
extern WatchdogType Watchdog;
