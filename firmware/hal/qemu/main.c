/* The firmware on a Cortex-M of QEMU, mps2-an385 (M3) or mps2-an500 (M7 with doubles): startup, tick and UARTs of the
 * board, the host on UART0, the plant on UART1 in place of encoders and amplifier. Registers and interrupts: ARM CMSDK
 * (APB UART), ARM AN385, ARMv7-M (SysTick, NVIC, CPACR).
 *
 *     qemu-system-arm -M mps2-an385 -nographic -monitor none -serial tcp:HOST:LINK -serial tcp:HOST:PLANT -kernel FILE
 *
 * The plant speaks as with hal/native/main.c: per sample 24 bytes in (time, axis, wheel, current, valid, how many bytes
 * the host has sent, which are waited for as far as the sample takes them), 8 bytes out (voltage, how many bytes have
 * gone to the host), so that a run can be repeated byte by byte. A sample begins with a tick, and its time is the
 * plant's, which waits while the board does.
 */
#include "hal.h"
#include "startup.h"

#define LINK 0x40004000u
#define PLANT 0x40005000u
#define DATA 0x00u
#define STATE 0x04u /* 1: transmitter full, 2: a byte has come */
#define CONTROL 0x08u
#define PENDING 0x0Cu
#define DIVIDER 0x10u
#define NVIC 0xE000E100u
#define SYSTICK 0xE000E010u
#define CLOCK 25000000u

#define TOLD 24
#define ANSWER 8
#define PATIENCE 1000000u /* looks at a transmitter that stays full before its host counts as gone: some 10 ms */

/* ---- the board; a test states its own ---- */
#ifndef RATE
#define RATE 1000
#endif
#ifndef AXIS_COUNTS
#define AXIS_COUNTS 16384
#endif
#ifndef WHEEL_COUNTS
#define WHEEL_COUNTS 16384
#endif
#ifndef VOLTAGE_LIMIT
#define VOLTAGE_LIMIT 10
#endif
#ifndef FIRMWARE
#define FIRMWARE 0
#endif
#ifndef TICK_RATE
#define TICK_RATE RATE /* higher: a plant in lockstep may be faster than real time */
#endif

typedef struct {
    uint32_t uart;
    volatile uint32_t in, out;
    volatile uint8_t bytes[2048];
} queue;

static queue from_link = {.uart = LINK}, from_plant = {.uart = PLANT};
static volatile uint32_t ticks;
static uint32_t ticks_seen, wanted, received, passed_on;
static uint8_t told[TOLD];
static union {
    float number;
    uint32_t bits;
} applied;
static int fresh, answered = 1;

static uint32_t u32_at(const uint8_t *p) {
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* 1 where the byte has gone out. */
static int put(uint32_t uart, uint8_t byte) {
    for (uint32_t looks = 0; REGISTER(uart + STATE) & 1u; looks++) {
        if (looks == PATIENCE) return 0;
    }
    REGISTER(uart + DATA) = byte;
    return 1;
}

static void put_u32(uint32_t uart, uint32_t x) {
    for (int i = 0; i < 4; i++) put(uart, (uint8_t)(x >> 8 * i));
}

/* Take what has come; where the queue is full it stays in the UART, which holds its sender up until there is room. */
static void on_byte(queue *into) {
    REGISTER(into->uart + PENDING) = 2; /* before the byte is taken: the next one raises it again */
    while (into->in - into->out < sizeof into->bytes && REGISTER(into->uart + STATE) & 2u) {
        into->bytes[into->in % sizeof into->bytes] = (uint8_t)REGISTER(into->uart + DATA);
        into->in = into->in + 1;
    }
}

static void on_link(void) { on_byte(&from_link); }
static void on_plant(void) { on_byte(&from_plant); }

static uint8_t get(queue *from) {
    uint8_t byte;
    while (from->in == from->out) __asm__ volatile("wfi");
    byte = from->bytes[from->out % sizeof from->bytes];
    from->out = from->out + 1;
    if (REGISTER(from->uart + STATE) & 2u) {
        __asm__ volatile("cpsid i");
        on_byte(from);
        __asm__ volatile("cpsie i");
    }
    return byte;
}

/* One exchange with the plant: the answer of the last sample, and the readings of the next. */
static void exchange(void) {
    if (!answered) {
        put_u32(PLANT, applied.bits);
        put_u32(PLANT, passed_on);
        answered = 1;
    }
    for (int i = 0; i < TOLD; i++) told[i] = get(&from_plant);
    wanted = u32_at(told + 20);
}

int hal_receive(uint8_t *bytes, int room) {
    int count = 0;
    if (!fresh) exchange();
    fresh = 1;
    while (count < room && received != wanted) {
        bytes[count++] = get(&from_link);
        received++;
    }
    return count;
}

int hal_wait(void) {
    while (ticks == ticks_seen) __asm__ volatile("wfi");
    ticks_seen = ticks;
    fresh = 0;
    return 1;
}

void hal_read(swingid_inputs *inputs) {
    union {
        uint32_t bits;
        float number;
    } current;
    current.bits = u32_at(told + 12);
    inputs->time = u32_at(told);
    inputs->axis = (int32_t)u32_at(told + 4);
    inputs->wheel = (int32_t)u32_at(told + 8);
    inputs->current = current.number;
    inputs->valid = u32_at(told + 16) != 0;
}

void hal_apply(float voltage, int armed) {
    (void)armed;
    applied.number = voltage;
    answered = 0;
}

int hal_send(const uint8_t *bytes, int size) {
    int count = 0;
    while (count < size && put(LINK, bytes[count])) count++;
    passed_on += (uint32_t)count;
    return count;
}

static void on_tick(void) { ticks = ticks + 1; }

static void hang(void) {
    for (;;) {
    }
}

static void uart(uint32_t base) {
    REGISTER(base + DIVIDER) = 16;
    REGISTER(base + CONTROL) = 1u | 2u | 8u; /* both directions, an interrupt for each byte that comes */
}

void reset(void) {
    static const swingid_config config = {(float)RATE, AXIS_COUNTS, WHEEL_COUNTS, (float)VOLTAGE_LIMIT, FIRMWARE,
                                          SWINGID_MOST_ORDER, 0};
    load_memory();
    uart(LINK);
    uart(PLANT);
    REGISTER(NVIC) = 1u << 0 | 1u << 2; /* receivers of both */
    REGISTER(SYSTICK + 0x04) = CLOCK / (uint32_t)(TICK_RATE) - 1;
    REGISTER(SYSTICK + 0x08) = 0;
    REGISTER(SYSTICK) = 7; /* processor's clock, interrupt, on */
    swingid_loop(&config);
    hang();
}

VECTORS vectors[16 + 3] = {
    CORE_VECTORS, [15] = {.call = on_tick}, [16] = {.call = on_link}, [18] = {.call = on_plant},
};
