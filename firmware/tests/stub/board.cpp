/* A board in the place of an Arduino core, which says what the sketch does to it: one line for each output, for the
 * watchdog and for each sample. A hundred samples, then a loop that does all but wait for the next one.
 */
#include <stdio.h>

#include "Adafruit_SleepyDog.h"
#include "Arduino.h"
#include "IWatchdog.h"
#include "SPI.h"
#include "Watchdog_t4.h"
#include "driver/gpio.h"
#include "esp_rom_gpio.h"
#include "esp_task_wdt.h"
#include "hardware/watchdog.h"

extern "C" {
#include "hal.h"
}

static uint32_t now;

static void started(double ms) { printf("watchdog %g\n", ms); }
static void fed() { printf("fed %u\n", (unsigned)now); }

void pinMode(int pin, int mode) { printf("mode %d %s\n", pin, mode == OUTPUT ? "output" : "input"); }
void digitalWrite(int pin, int level) { printf("level %d %d\n", pin, level); }
int digitalRead(int) { return 0; }
void analogWrite(int pin, int duty) { printf("duty %d %d\n", pin, duty); }
void analogWriteResolution(int bits) { printf("bits %d\n", bits); }
int digitalPinToInterrupt(int pin) { return pin; }
void attachInterrupt(int, void (*)(), int) {}
void noInterrupts() {}
void interrupts() {}
uint32_t micros() { return now += 5; }

SerialPort Serial;
void SerialPort::begin(unsigned long) {}
int SerialPort::available() { return 1000; } /* a flood */
int SerialPort::read() { return 0x55; }
#ifndef ROOM
#define ROOM 64 /* 0: a core that never tells it */
#endif
int SerialPort::availableForWrite() { return ROOM; }
size_t SerialPort::write(const uint8_t *, size_t size) { return size; }

SPIPort SPI;
SPISettings::SPISettings(uint32_t, int, int) {}
void SPIPort::begin() {}
void SPIPort::beginTransaction(SPISettings) {}
uint16_t SPIPort::transfer16(uint16_t) { return 0; }
void SPIPort::endTransaction() {}

WatchdogType Watchdog;
int WatchdogType::enable(int ms) { return started(ms), ms; }
void WatchdogType::reset() { fed(); }
IWatchdogClass IWatchdog;
void IWatchdogClass::begin(uint32_t us) { started(us / 1e3); }
void IWatchdogClass::reload() { fed(); }
bool IWatchdogClass::isEnabled() { return true; }
void begin_t4(double ms) { started(ms); }
void feed_t4() { fed(); }
void watchdogEnable(uint32_t ms) { started(ms); }
void watchdogReset() { fed(); }
bool ledcAttach(uint8_t, uint32_t, uint8_t bits) { return printf("bits %d\n", bits) > 0; }
bool ledcWrite(uint8_t pin, uint32_t duty) { return printf("duty %d %u\n", pin, (unsigned)duty) > 0; }

extern "C" {
void watchdog_enable(uint32_t ms, bool) { started(ms); }
void watchdog_update() { fed(); }
int esp_task_wdt_reconfigure(const esp_task_wdt_config_t *) { return 1; } /* not started yet */
int esp_task_wdt_init(const esp_task_wdt_config_t *config) {
    if (config->trigger_panic && config->idle_core_mask == 0) started(config->timeout_ms);
    return ESP_OK;
}
int esp_task_wdt_add(void *) { return ESP_OK; }
int esp_task_wdt_reset() { return fed(), ESP_OK; }
void esp_rom_gpio_connect_out_signal(uint32_t pin, uint32_t, bool, bool) { printf("plain %u\n", (unsigned)pin); }
int gpio_set_level(gpio_num_t pin, uint32_t level) { return printf("level %d %u\n", pin, (unsigned)level); }
void __attribute__((weak)) esp_task_wdt_isr_user_handler() {}

void swingid_loop(const swingid_config *config) {
    swingid_inputs inputs;
    uint8_t bytes[128];
    printf("loop %g\n", (double)config->rate);
    for (int i = 0; i < 100; i++) {
        if (hal_receive(bytes, 100) != 100) printf("received\n");
        hal_wait();
        printf("sample %u\n", (unsigned)now);
        hal_read(&inputs);
        hal_apply(i % 2 ? 6.0f : -6.0f, 1);
        if (hal_send(bytes, 100) != 64) printf("sent\n");
    }
    printf("hung\n");
    for (int i = 0; i < 100000; i++) {
        hal_receive(bytes, 100);
        hal_read(&inputs);
        hal_send(bytes, 100);
    }
    printf("interrupt\n");
    esp_task_wdt_isr_user_handler();
}
}

int main() {
#if defined(ARDUINO_ARCH_SAM)
    watchdogSetup();
#endif
    setup();
    loop();
    return 0;
}
