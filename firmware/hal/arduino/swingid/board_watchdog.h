// The board's own watchdog, which resets a board that takes no samples: its pins are inputs then, so each pin of the
// bridge needs a resistor to ground. watchdog_start() is false where there is none, watchdog_feed() puts it off.
#ifndef SWINGID_BOARD_WATCHDOG_H
#define SWINGID_BOARD_WATCHDOG_H

// ms: half of what a host that has died may take. Boards round it down, SAMD to 31 ms, Due to 47 ms.
static const uint32_t WATCHDOG_MS = 50;

#if defined(ARDUINO_ARCH_SAM)  // Due: the core starts it before setup(), and once only

void watchdogSetup(void) { watchdogEnable(WATCHDOG_MS); }
static bool watchdog_start() { return true; }
static void watchdog_feed() { watchdogReset(); }

#elif defined(ARDUINO_ARCH_SAMD)  // needs the library Adafruit SleepyDog

#include <Adafruit_SleepyDog.h>
static bool watchdog_start() { return Watchdog.enable((int)WATCHDOG_MS) > 0; }
static void watchdog_feed() { Watchdog.reset(); }

#elif defined(ARDUINO_ARCH_ESP32)  // core 3 (ESP-IDF 5); its interrupt watchdog sees interrupts that stay off

#include <driver/gpio.h>
#include <esp_rom_gpio.h>
#include <esp_task_wdt.h>
#include <soc/gpio_sig_map.h>

// Before it resets, the board prints for some 100 ms, in which the PWM would go on.
extern "C" void IRAM_ATTR esp_task_wdt_isr_user_handler(void) {
    gpio_set_level((gpio_num_t)BRIDGE_PWM, 0);
    gpio_set_level((gpio_num_t)BRIDGE_DIRECTION, 0);
    esp_rom_gpio_connect_out_signal(BRIDGE_PWM, SIG_GPIO_OUT_IDX, false, false);
}

static bool watchdog_start() {
    esp_task_wdt_config_t config = {};
    config.timeout_ms = WATCHDOG_MS;
    config.idle_core_mask = 0;  // the loop of the samples leaves no time to its core's idle task
    config.trigger_panic = true;
    if (esp_task_wdt_reconfigure(&config) != ESP_OK && esp_task_wdt_init(&config) != ESP_OK) return false;
    return esp_task_wdt_add(NULL) == ESP_OK;
}
static void watchdog_feed() { esp_task_wdt_reset(); }

#elif defined(ARDUINO_ARCH_RP2040)

#include <hardware/watchdog.h>
static bool watchdog_start() {
    watchdog_enable(WATCHDOG_MS, false);
    return true;
}
static void watchdog_feed() { watchdog_update(); }

#elif defined(__IMXRT1062__)  // Teensy 4; needs the library WDT_T4, whose third watchdog takes 32 ms and more

#include <Watchdog_t4.h>
static WDT_T4<WDT3> board_watchdog;
static bool watchdog_start() {
    WDT_timings_t config;
    config.timeout = WATCHDOG_MS;
    board_watchdog.begin(config);
    return true;
}
static void watchdog_feed() { board_watchdog.feed(); }

#elif defined(ARDUINO_ARCH_STM32)

#include <IWatchdog.h>
static bool watchdog_start() {
    IWatchdog.begin(WATCHDOG_MS * 1000);
    return IWatchdog.isEnabled();
}
static void watchdog_feed() { IWatchdog.reload(); }

#else
#error "No watchdog is known of this board: add watchdog_start and watchdog_feed, or a board that hangs holds its motor"
#endif

#endif
