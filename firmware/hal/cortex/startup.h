/* What comes before the firmware on a Cortex-M without a vendor's library: memory, vectors, and the copies that
 * compilers put in. `reset` and `hang` are the board's; memory.ld of the board and sections.ld say where all lies.
 */
#ifndef SWINGID_STARTUP_H
#define SWINGID_STARTUP_H

#include <stddef.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define CPACR 0xE000ED88u

extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_top;

void reset(void);
static void hang(void);

typedef union {
    uint32_t *stack;
    void (*call)(void);
} vector;

/* Stack, reset, and each fault of the processor; a board adds its own from 15 (SysTick) on. */
#define CORE_VECTORS                                                                                                \
    [0] = {.stack = &stack_top}, [1] = {.call = reset}, [2] = {.call = hang}, [3] = {.call = hang},                 \
    [4] = {.call = hang}, [5] = {.call = hang}, [6] = {.call = hang}, [11] = {.call = hang}, [14] = {.call = hang}
#define VECTORS __attribute__((section(".vectors"), used)) static const vector

/* Variables as the program states them; the processor's unit for floats where the code is built for one. */
static inline void load_memory(void) {
    const uint32_t *from = &data_load;
    for (uint32_t *to = &data_start; to < &data_end;) *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;) *to++ = 0;
#ifdef __ARM_FP
    REGISTER(CPACR) |= 15u << 20;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
#endif
}

void *memcpy(void *restrict to, const void *restrict from, size_t size) {
    uint8_t *t = to;
    const uint8_t *f = from;
    while (size--) *t++ = *f++;
    return to;
}

void *memset(void *to, int value, size_t size) {
    uint8_t *t = to;
    while (size--) *t++ = (uint8_t)value;
    return to;
}

#endif
