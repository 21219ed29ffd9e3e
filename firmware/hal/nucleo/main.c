/* The reference board: Nucleo-F446RE at 180 MHz, without a vendor's library. Two AS5048A on SPI1, an H-bridge with PWM,
 * direction and enable on TIM1, the host on USART2, which the board's debugger gives it as a virtual COM port of
 * 1 Mbaud, a watchdog of 20 ms. Registers and bits: ST RM0390; the pins of the board: ST UM1724.
 *
 *     D13 PA5 clock, D12 PA6 data in, D11 PA7 data out; D10 PB6 selects the axis, D9 PC7 the wheel
 *     D7 PA8 PWM, D8 PA9 direction, D6 PB10 enable: each with a resistor to ground, as until reset() begins they float
 *
 * There are no interrupts: DMA moves the bytes of the host, so that nothing comes between the readings of a sample and
 * its voltage. The enable is low from the reset until Arm, and whenever a run has ended. The time is that of the
 * debugger's crystal, which the inertia found is only as good as: the internal oscillator is off by 1 % and more.
 * Without it the board does not start, and where it fails in a run the bridge is off and the watchdog resets the board.
 * Doubles and floats are computed without the processor's unit for floats, so that every bit is that of the other
 * builds of the core (`make nucleo SINGLE=1` is the one that is not); tests/firmware/test_nucleo.py executes the image and counts
 * what a sample costs.
 */
#include "encoders.h"
#include "hal.h"
#include "startup.h"

#define RCC 0x40023800u
#define PWR 0x40007000u
#define FLASH 0x40023C00u
#define GPIOA 0x40020000u
#define GPIOB 0x40020400u
#define GPIOC 0x40020800u
#define TIM1 0x40010000u /* PWM */
#define TIM2 0x40000000u /* microseconds, 32 bits */
#define TIM6 0x40001000u /* samples */
#define SPI1 0x40013000u
#define USART2 0x40004400u
#define DMA1 0x40026000u
#define FROM_HOST (DMA1 + 0x10 + 5 * 0x18) /* stream 5 */
#define TO_HOST (DMA1 + 0x10 + 6 * 0x18)   /* stream 6 */
#define IWDG 0x40003000u

/* ---- your bridge ---- */
#ifndef SUPPLY
#define SUPPLY 12.0f /* V at the bridge */
#endif
#ifndef VOLTAGE_LIMIT
#define VOLTAGE_LIMIT 10.0f /* V, below the supply */
#endif

#define RATE 1000u
#ifndef MOST_ORDER
#if defined(SWINGID_SINGLE) && !defined(__ARM_FP)
#error "SINGLE=1 is for the unit for floats, which this compiler does not use: build it with arm-none-eabi-gcc"
#elif defined(SWINGID_SINGLE)
#define MOST_ORDER 4
#elif defined(__clang__)
#define MOST_ORDER 2 /* its doubles take half as long again as gcc's */
#else
#define MOST_ORDER 3 /* tests/firmware/test_nucleo.py: order 4 costs more than a sample has */
#endif
#endif
#define PWM_STEPS 9000u /* 20 kHz of 180 MHz */

/* Looks at a register before what it waits for counts as missing. At 16 MHz that is 100 ms at least, which ST's own
 * library gives a clock to start; for a transfer of 6 us it is a thousandth of this. */
#define PATIENCE 200000

extern uint32_t image_start, image_end;

typedef struct {
    uint32_t port, pin; /* that selects it */
    int32_t total;      /* counts over many turns */
    int failed;         /* its last answers said that it misunderstood: to be cleared before it is read */
} encoder;

static encoder axis = {GPIOB, 6, 0, 0}, wheel = {GPIOC, 7, 0, 0};
static volatile uint8_t came[4096], goes[SWINGID_OUTPUT_ROOM];
static uint32_t came_out;

/* Mode of a pin: 1 output, 2 the alternate function. */
static void pin(uint32_t port, unsigned number, unsigned mode, unsigned function) {
    const uint32_t half = port + 0x20 + (number / 8) * 4, place = number % 8 * 4;
    REGISTER(half) = (REGISTER(half) & ~(15u << place)) | function << place;
    REGISTER(port) = (REGISTER(port) & ~(3u << 2 * number)) | mode << 2 * number;
    REGISTER(port + 0x08) |= 2u << 2 * number;
}

static void set(uint32_t port, unsigned number, int high) {
    REGISTER(port + 0x18) = high ? 1u << number : 1u << (16 + number);
}

/* The bridge's three pins are plain outputs at 0, whatever timer, clock and memory do. */
static void bridge_off(void) {
    REGISTER(RCC + 0x30) |= 7u; /* GPIOA, GPIOB, GPIOC */
    (void)REGISTER(RCC + 0x30); /* a port's clock takes two cycles */
    set(GPIOB, 10, 0);
    set(GPIOA, 8, 0);
    set(GPIOA, 9, 0);
    pin(GPIOB, 10, 1, 0);
    pin(GPIOA, 8, 1, 0);
    pin(GPIOA, 9, 1, 0);
}

/* Faults of processor and clock (NMI) come here, too: the watchdog, which is fed no more, resets the board. */
static void hang(void) {
    bridge_off();
    for (;;) {
    }
}

static void watchdog(void) {
    REGISTER(IWDG) = 0xCCCC;
    REGISTER(IWDG) = 0x5555;
    REGISTER(IWDG + 0x04) = 0;   /* 32 kHz / 4 */
    REGISTER(IWDG + 0x08) = 160; /* 20 ms; 14 to 38 ms, as far as that oscillator may be off */
}

/* Wait for bits of a register to have a value; where they don't get it, the board does not start. */
static void require(uint32_t address, uint32_t bits, uint32_t value) {
    for (int looks = 0; (REGISTER(address) & bits) != value; looks++) {
        if (looks == PATIENCE) hang();
        REGISTER(IWDG) = 0xAAAA;
    }
}

static void clocks(void) {
    REGISTER(RCC) |= 1u << 18; /* a clock, no crystal: the 8 MHz of the debugger */
    REGISTER(RCC) |= 1u << 16;
    require(RCC, 1u << 17, 1u << 17);
    REGISTER(RCC) |= 1u << 19; /* clock security system: NMI where it fails */
    REGISTER(RCC + 0x40) |= 1u << 28;
    (void)REGISTER(RCC + 0x40);
    REGISTER(PWR) |= 3u << 14;                                             /* scale 1 */
    REGISTER(RCC + 0x04) = 4u | 180u << 6 | 1u << 22 | 8u << 24 | 2u << 28; /* PLL: 8 MHz / 4 * 180 / 2 */
    REGISTER(RCC) |= 1u << 24;
    REGISTER(PWR) |= 1u << 16; /* over-drive, which 180 MHz need */
    require(PWR + 0x04, 1u << 16, 1u << 16);
    REGISTER(PWR) |= 1u << 17;
    require(PWR + 0x04, 1u << 17, 1u << 17);
    require(RCC, 1u << 25, 1u << 25);
    REGISTER(FLASH) = 5u | 1u << 8 | 1u << 9 | 1u << 10; /* five wait states, prefetch, caches */
    require(FLASH, 15u, 5u);
    REGISTER(RCC + 0x08) = 5u << 10 | 4u << 13 | 2u; /* APB1 45 MHz, APB2 90 MHz, clock from the PLL */
    require(RCC + 0x08, 12u, 8u);
    REGISTER(RCC + 0x30) |= 1u << 21;                     /* DMA1 */
    REGISTER(RCC + 0x40) |= 1u << 0 | 1u << 4 | 1u << 17; /* TIM2, TIM6, USART2 */
    REGISTER(RCC + 0x44) |= 1u << 0 | 1u << 12;           /* TIM1, SPI1 */
    (void)REGISTER(RCC + 0x44);
}

/* TIM1 makes 20 cycles of the PWM a sample, the first ends 15 us after its begin: a voltage of a controller of order 1 is
 * there between 70 and 112 us (tests/firmware/test_nucleo.py) and so begins at 115 us in each sample. */
static void timers(void) {
    REGISTER(TIM2 + 0x28) = 89; /* 90 MHz / 90 */
    REGISTER(TIM2 + 0x2C) = 0xFFFFFFFFu;
    REGISTER(TIM2 + 0x14) = 1;
    REGISTER(TIM1 + 0x2C) = PWM_STEPS - 1;
    REGISTER(TIM1 + 0x34) = 0;
    REGISTER(TIM1 + 0x18) = 6u << 4 | 1u << 3; /* PWM mode 1, taken over at the end of a cycle */
    REGISTER(TIM1 + 0x20) = 1;
    REGISTER(TIM1 + 0x44) = 1u << 15;
    REGISTER(TIM1 + 0x14) = 1;
    REGISTER(TIM1 + 0x24) = PWM_STEPS / 50 * 35;
    REGISTER(TIM6 + 0x28) = 89;
    REGISTER(TIM6 + 0x2C) = 1000000u / RATE - 1;
    REGISTER(TIM6 + 0x14) = 1;
    REGISTER(TIM6 + 0x10) = 0;
    REGISTER(TIM2) = 1;
    REGISTER(TIM1) = 1;
    REGISTER(TIM6) = 1;
    pin(GPIOA, 8, 2, 1); /* the timer gives 0 by now */
}

static void ports(void) {
    set(GPIOB, 6, 1);
    set(GPIOC, 7, 1);
    pin(GPIOB, 6, 1, 0);
    pin(GPIOC, 7, 1, 0);
    for (unsigned i = 5; i <= 7; i++) pin(GPIOA, i, 2, 5);
    REGISTER(SPI1) = 1u | 1u << 2 | 4u << 3 | 1u << 6 | 3u << 8 | 1u << 11; /* mode 1, 90 MHz / 32, 16 bits */
    pin(GPIOA, 2, 2, 7);
    pin(GPIOA, 3, 2, 7);
    REGISTER(USART2 + 0x08) = 45; /* 45 MHz / 1 Mbaud */
    REGISTER(USART2 + 0x14) = 3u << 6;
    REGISTER(USART2 + 0x0C) = 1u << 13 | 3u << 2;
    REGISTER(FROM_HOST + 0x08) = REGISTER(TO_HOST + 0x08) = USART2 + 0x04;
    REGISTER(FROM_HOST + 0x0C) = (uint32_t)(uintptr_t)came;
    REGISTER(FROM_HOST + 0x04) = sizeof came;
    REGISTER(FROM_HOST) = 4u << 25 | 1u << 10 | 1u << 8 | 1u; /* channel 4, round and round */
    REGISTER(TO_HOST + 0x0C) = (uint32_t)(uintptr_t)goes;
}

int hal_wait(void) {
    while (!(REGISTER(TIM6 + 0x10) & 1u)) {
    }
    REGISTER(TIM6 + 0x10) = 0;
    REGISTER(IWDG) = 0xAAAA;
    return 1;
}

/* A word to an encoder and its answer to the word before; 0xFFFF, which is an error, where the port gives none. */
static uint16_t exchange(const encoder *with, uint16_t word) {
    uint16_t answer;
    int looks = 0;
    set(with->port, with->pin, 0);
    for (volatile int i = 0; i < 8; i++) { /* 350 ns from the selection to the clock */
    }
    REGISTER(SPI1 + 0x0C) = word;
    while (!(REGISTER(SPI1 + 0x08) & 1u) && looks < PATIENCE / 1000) looks++;
    answer = REGISTER(SPI1 + 0x08) & 1u ? (uint16_t)REGISTER(SPI1 + 0x0C) : 0xFFFFu;
    for (volatile int i = 0; i < 8; i++) { /* half a clock period to the end of the selection, as long between two */
    }
    set(with->port, with->pin, 1);
    return answer;
}

/* The answer to the first word of a sample is the diagnosis that the second word of the sample before has asked for. */
static int first_word(const encoder *with) {
    if (with->failed) exchange(with, AS5048A_CLEAR_ERROR);
    return as5048a_healthy(exchange(with, AS5048A_READ_ANGLE)) && !with->failed;
}

static int second_word(encoder *with, int healthy) {
    const uint16_t answer = exchange(with, AS5048A_READ_DIAGNOSIS);
    uint16_t angle;
    const int read = as5048a_angle(answer, &angle);
    with->failed = (answer & AS5048A_ERROR) != 0;
    if (read && healthy) with->total = swingid_extend(with->total, angle, AS5048A_BITS);
    return read && healthy;
}

void hal_read(swingid_inputs *inputs) {
    union {
        uint32_t bits;
        float number;
    } none;
    int axis_healthy, wheel_healthy, axis_read, wheel_read;
    none.bits = 0x7FC00000u;
    axis_healthy = first_word(&axis); /* both angles are those of the ends of these two frames */
    inputs->time = REGISTER(TIM2 + 0x24);
    wheel_healthy = first_word(&wheel);
    axis_read = second_word(&axis, axis_healthy);
    wheel_read = second_word(&wheel, wheel_healthy);
    inputs->valid = axis_read && wheel_read;
    inputs->axis = axis.total;
    inputs->wheel = wheel.total;
    inputs->current = none.number;
}

void hal_apply(float voltage, int armed) {
    const float size = voltage < 0.0f ? -voltage : voltage;
    set(GPIOA, 9, voltage >= 0.0f);
    REGISTER(TIM1 + 0x34) = (uint32_t)(size / (float)SUPPLY * (float)PWM_STEPS + 0.5f);
    set(GPIOB, 10, armed);
}

int hal_receive(uint8_t *bytes, int room) {
    const uint32_t came_in = sizeof came - REGISTER(FROM_HOST + 0x04);
    int count = 0;
    if (REGISTER(USART2) & 1u << 3) (void)REGISTER(USART2 + 0x04); /* a byte was lost: its frame's check tells */
    while (count < room && came_out != came_in % sizeof came) {
        bytes[count++] = came[came_out];
        came_out = (came_out + 1) % sizeof came;
    }
    return count;
}

int hal_send(const uint8_t *bytes, int size) {
    if (REGISTER(TO_HOST) & 1u) return 0; /* the last bytes still go out */
    for (int i = 0; i < size; i++) goes[i] = bytes[i];
    __asm__ volatile("dsb" ::: "memory");
    REGISTER(DMA1 + 0x0C) = 0x3Du << 16; /* its flags */
    REGISTER(TO_HOST + 0x04) = (uint32_t)size;
    REGISTER(TO_HOST) = 4u << 25 | 1u << 10 | 1u << 6 | 1u;
    return size;
}

/* CRC-32 as of zlib of what stands in the flash: the hash of this image. */
static uint32_t image_hash(void) {
    uint32_t hash = 0xFFFFFFFFu;
    for (const uint8_t *byte = (const uint8_t *)&image_start; byte < (const uint8_t *)&image_end; byte++) {
        hash ^= *byte;
        for (int i = 0; i < 8; i++) hash = hash >> 1 ^ (hash & 1u ? 0xEDB88320u : 0);
    }
    return ~hash;
}

void reset(void) {
    swingid_config config = {(float)RATE, 1u << AS5048A_BITS, 1u << AS5048A_BITS, (float)VOLTAGE_LIMIT, 0, MOST_ORDER, 0};
    swingid_inputs first;
    bridge_off();
    watchdog();
    load_memory();
    clocks();
    config.firmware = image_hash();
    ports();
    timers();
    hal_apply(0.0f, 0);
    hal_read(&first); /* asks for the first diagnosis */
    swingid_loop(&config);
    hang();
}

VECTORS vectors[16] = {CORE_VECTORS, [15] = {.call = hang}};
