#pragma once
#include <stdint.h>
typedef int gpio_num_t;
extern "C" int gpio_set_level(gpio_num_t, uint32_t);
