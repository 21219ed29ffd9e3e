#pragma once
enum WDT_DEV_TABLE { WDT1, WDT2, WDT3 };
struct WDT_timings_t {
    double timeout;
};
void begin_t4(double);
void feed_t4();
template <WDT_DEV_TABLE which>
struct WDT_T4 {
    void begin(WDT_timings_t config) { begin_t4(config.timeout); }
    void feed() { feed_t4(); }
};
