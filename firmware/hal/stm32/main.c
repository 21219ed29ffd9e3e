/* STM32F405 at 168 MHz without a vendor's library: AS5048A on SPI1, AMT103 on the counter of TIM4, an H-bridge on TIM1,
 * the host on USART2 at 1 Mbaud, a watchdog of 20 ms. Registers and bits: ST RM0090. A sketch to start from: it is
 * compiled, linked and run on a simulated processor by the tests, and has not run on a board.
 *
 *     axis:  PA4 select, PA5 clock, PA6 data in, PA7 data out     wheel: PB6 A, PB7 B
 *     bridge: PA8 PWM, PB0 direction                              host:  PA2 out, PA3 in
 *
 * Its time is that of the crystal, which the inertia found is only as good as: the internal oscillator is off by 1 %
 * and more. Without a crystal it does not start, and one that fails in a run ends it: the bridge is off, the watchdog
 * resets the board. With another board's CRYSTAL the baud rate is wrong, too, so no host gets an answer. Until reset()
 * begins the pins of the bridge are inputs, so each needs a resistor to ground.
 */
#include "encoders.h"
#include "hal.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define RCC 0x40023800u
#define GPIOA 0x40020000u
#define GPIOB 0x40020400u
#define TIM1 0x40010000u /* PWM */
#define TIM2 0x40000000u /* microseconds, 32 bits */
#define TIM4 0x40000800u /* wheel */
#define TIM6 0x40001000u /* samples */
#define SPI1 0x40013000u
#define USART2 0x40004400u
#define IWDG 0x40003000u
#define FLASH 0x40023C00u
#define CPACR 0xE000ED88u

/* ---- your board ---- */
#define RATE 1000u
#define CRYSTAL 8u /* MHz, 4 to 26: 8 on the Discovery, 12 on Pyboard 1.1 and Feather F405; look at your board */
#define SUPPLY 12.0f       /* V at the bridge */
#define VOLTAGE_LIMIT 10.0f /* V, below the supply */
#define WHEEL_COUNTS 8192u  /* AMT103 at 2048 pulses per turn */
#define PWM_STEPS 8400u     /* 20 kHz */

#if CRYSTAL < 4 || CRYSTAL > 26
#error "CRYSTAL must be the MHz of your board's crystal, 4 to 26"
#endif

/* Looks at a register before what it waits for counts as missing. At 16 MHz that is 100 ms at least, which ST's own
 * library gives a crystal to start; for a transfer of 3 us it is a thousandth of this. */
#define PATIENCE 200000

extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_top;

static volatile uint8_t came[1024], goes[256];
static volatile uint32_t came_in, came_out, goes_in, goes_out;
static int32_t axis, wheel;

/* Mode of a pin: 1 output, 2 the alternate function. */
static void pin(uint32_t port, unsigned number, unsigned mode, unsigned function) {
    const uint32_t half = port + 0x20 + (number / 8) * 4, place = number % 8 * 4;
    REGISTER(half) = (REGISTER(half) & ~(15u << place)) | function << place;
    REGISTER(port) = (REGISTER(port) & ~(3u << 2 * number)) | mode << 2 * number;
    REGISTER(port + 0x08) |= 2u << 2 * number;
}

/* Both pins are plain outputs at 0, whatever timer, clock and memory do. */
static void bridge_off(void) {
    REGISTER(RCC + 0x30) |= 3u; /* GPIOA, GPIOB */
    (void)REGISTER(RCC + 0x30); /* a port's clock takes two cycles */
    REGISTER(GPIOA + 0x18) = 1u << (16 + 8);
    REGISTER(GPIOB + 0x18) = 1u << (16 + 0);
    pin(GPIOA, 8, 1, 0);
    pin(GPIOB, 0, 1, 0);
}

/* Faults of processor and crystal (NMI) come here, too: the watchdog, which is fed no more, resets the board. */
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
    REGISTER(RCC) |= 1u << 16; /* crystal on */
    require(RCC, 1u << 17, 1u << 17);
    REGISTER(RCC) |= 1u << 19;                           /* clock security system: NMI where it fails */
    REGISTER(FLASH) = 5u | 1u << 8 | 1u << 9 | 1u << 10; /* five wait states, prefetch, caches */
    REGISTER(RCC + 0x04) = CRYSTAL | 336u << 6 | 0u << 16 | 1u << 22 | 7u << 24; /* PLL: crystal / CRYSTAL * 336 / 2 */
    REGISTER(RCC) |= 1u << 24;
    require(RCC, 1u << 25, 1u << 25);
    REGISTER(RCC + 0x08) = 5u << 10 | 4u << 13 | 2u; /* APB1 42 MHz, APB2 84 MHz, clock from the PLL */
    require(RCC + 0x08, 12u, 8u);
    REGISTER(RCC + 0x40) |= 1u << 0 | 1u << 2 | 1u << 4 | 1u << 17; /* TIM2, TIM4, TIM6, USART2 */
    REGISTER(RCC + 0x44) |= 1u << 0 | 1u << 12;                     /* TIM1, SPI1 */
    (void)REGISTER(RCC + 0x44);
}

static void timers(void) {
    REGISTER(TIM2 + 0x28) = 83; /* 84 MHz / 84 */
    REGISTER(TIM2 + 0x2C) = 0xFFFFFFFFu;
    REGISTER(TIM2 + 0x14) = 1;
    REGISTER(TIM2) = 1;
    REGISTER(TIM4 + 0x18) = 1u | 1u << 8 | 3u << 4 | 3u << 12; /* both inputs, filtered */
    REGISTER(TIM4 + 0x08) = 3;                                 /* count all edges */
    REGISTER(TIM4 + 0x2C) = 0xFFFF;
    REGISTER(TIM4) = 1;
    REGISTER(TIM1 + 0x2C) = PWM_STEPS - 1;
    REGISTER(TIM1 + 0x34) = 0;
    REGISTER(TIM1 + 0x18) = 6u << 4 | 1u << 3; /* PWM mode 1, taken over at the end of a cycle */
    REGISTER(TIM1 + 0x20) = 1;
    REGISTER(TIM1 + 0x44) = 1u << 15;
    REGISTER(TIM1 + 0x14) = 1;
    REGISTER(TIM1) = 1;
    pin(GPIOA, 8, 2, 1); /* the timer gives 0 by now */
    REGISTER(TIM6 + 0x28) = 83;
    REGISTER(TIM6 + 0x2C) = 1000000u / RATE - 1;
    REGISTER(TIM6 + 0x14) = 1;
    REGISTER(TIM6 + 0x10) = 0;
    REGISTER(TIM6) = 1;
}

static void ports(void) {
    pin(GPIOA, 4, 1, 0);
    REGISTER(GPIOA + 0x18) = 1u << 4;
    for (unsigned i = 5; i <= 7; i++) pin(GPIOA, i, 2, 5);
    pin(GPIOB, 6, 2, 2);
    pin(GPIOB, 7, 2, 2);
    pin(GPIOA, 2, 2, 7);
    pin(GPIOA, 3, 2, 7);
    REGISTER(SPI1) = 1u | 1u << 2 | 3u << 3 | 1u << 6 | 3u << 8 | 1u << 11; /* mode 1, 84 MHz / 16, 16 bits */
    REGISTER(USART2 + 0x08) = 0x2A;                                         /* 42 MHz / 42 */
    REGISTER(USART2 + 0x0C) = 1u << 13 | 1u << 5 | 3u << 2;
    REGISTER(0xE000E104u) = 1u << (38 - 32); /* interrupt of USART2 */
}

/* A byte in, a byte out. A line that is full both ways calls it 200000 times a second, some 60 cycles each: 7 % of the
 * processor, and no more, whatever the host sends. */
static void on_usart2(void) {
    const uint32_t status = REGISTER(USART2);
    if (status & (1u << 5 | 1u << 3)) {                        /* a byte, or one lost */
        const uint8_t byte = (uint8_t)REGISTER(USART2 + 0x04); /* clears both */
        if (status & 1u << 5 && came_in - came_out < sizeof came) {
            came[came_in % sizeof came] = byte;
            came_in = came_in + 1;
        }
    }
    if (status & 1u << 7) {
        if (goes_out != goes_in) {
            REGISTER(USART2 + 0x04) = goes[goes_out % sizeof goes];
            goes_out = goes_out + 1;
        } else {
            REGISTER(USART2 + 0x0C) &= ~(1u << 7);
        }
    }
}

int hal_wait(void) {
    while (!(REGISTER(TIM6 + 0x10) & 1u)) {
    }
    REGISTER(TIM6 + 0x10) = 0;
    REGISTER(IWDG) = 0xAAAA;
    return 1;
}

static uint16_t exchange(uint16_t word) {
    uint16_t answer;
    REGISTER(GPIOA + 0x18) = 1u << (16 + 4);
    REGISTER(SPI1 + 0x0C) = word;
    for (int looks = 0; !(REGISTER(SPI1 + 0x08) & 1u) && looks < PATIENCE / 1000; looks++) {
    }
    answer = REGISTER(SPI1 + 0x08) & 1u ? (uint16_t)REGISTER(SPI1 + 0x0C) : 0xFFFFu; /* that is an error, no reading */
    REGISTER(GPIOA + 0x18) = 1u << 4;
    for (volatile int i = 0; i < 20; i++) { /* 350 ns between two frames */
    }
    return answer;
}

void hal_read(swingid_inputs *inputs) {
    union {
        uint32_t bits;
        float number;
    } none;
    uint16_t angle;
    none.bits = 0x7FC00000u;
    exchange(AS5048A_READ_ANGLE);
    inputs->time = REGISTER(TIM2 + 0x24);
    wheel = swingid_extend(wheel, REGISTER(TIM4 + 0x24), 16);
    inputs->valid = as5048a_angle(exchange(AS5048A_READ_ANGLE), &angle);
    if (inputs->valid) axis = swingid_extend(axis, angle, AS5048A_BITS);
    inputs->axis = axis;
    inputs->wheel = wheel;
    inputs->current = none.number;
}

void hal_apply(float voltage) {
    const float size = voltage < 0.0f ? -voltage : voltage;
    REGISTER(GPIOB + 0x18) = voltage < 0.0f ? 1u << 16 : 1u;
    REGISTER(TIM1 + 0x34) = (uint32_t)(size / SUPPLY * (float)PWM_STEPS + 0.5f);
}

int hal_receive(uint8_t *bytes, int room) {
    int count = 0;
    while (count < room && came_out != came_in) {
        bytes[count++] = came[came_out % sizeof came];
        came_out = came_out + 1;
    }
    return count;
}

int hal_send(const uint8_t *bytes, int size) {
    int count = 0;
    while (count < size && goes_in - goes_out < sizeof goes) {
        goes[goes_in % sizeof goes] = bytes[count++];
        goes_in = goes_in + 1;
    }
    REGISTER(USART2 + 0x0C) |= 1u << 7; /* the interrupt sends them */
    return count;
}

void reset(void) {
    static const swingid_config config = {(float)RATE, 1u << AS5048A_BITS, WHEEL_COUNTS, VOLTAGE_LIMIT, 0};
    uint32_t *from = &data_load;
    bridge_off();
    watchdog();
    for (uint32_t *to = &data_start; to < &data_end;) *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;) *to++ = 0;
    REGISTER(CPACR) |= 15u << 20; /* floating-point unit */
    clocks();
    ports();
    timers();
    hal_apply(0.0f);
    swingid_loop(&config);
    hang();
}

typedef void (*handler)(void);

__attribute__((section(".vectors"), used)) static const union {
    uint32_t *stack;
    handler call;
} vectors[16 + 39] = {
    [0] = {.stack = &stack_top}, [1] = {.call = reset},           [2] = {.call = hang}, [3] = {.call = hang},
    [4] = {.call = hang},        [5] = {.call = hang},            [6] = {.call = hang}, [11] = {.call = hang},
    [14] = {.call = hang},       [15] = {.call = hang},           [16 + 38] = {.call = on_usart2},
};
