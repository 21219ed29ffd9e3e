#pragma once
#include <stdint.h>
typedef int esp_err_t;
#define ESP_OK 0
struct esp_task_wdt_config_t {
    uint32_t timeout_ms, idle_core_mask;
    bool trigger_panic;
};
extern "C" esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t *);
extern "C" esp_err_t esp_task_wdt_init(const esp_task_wdt_config_t *);
extern "C" esp_err_t esp_task_wdt_add(void *);
extern "C" esp_err_t esp_task_wdt_reset();
