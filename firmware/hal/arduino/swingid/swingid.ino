// A board of the Arduino family: AS5048A on the axis (SPI), AMT103 on the wheel (two interrupt pins), an H-bridge with
// a direction, a PWM and an enable pin. A sketch to start from: it is compiled by the tests and has not run on a board.
//
// Copy firmware/core/*.c, firmware/core/*.h and firmware/hal/encoders/encoders.h beside this file. The board needs
// doubles of 64 bits (no AVR), and the compiler -ffp-contract=off (platform.local.txt: compiler.c.extra_flags=...).
// board_watchdog.h has the watchdogs of Due, SAMD, ESP32, RP2040, Teensy 4 and STM32duino: a board that takes no
// samples lets go of the motor. board_speed.h says what each can compute and count; Arm refuses what is beyond it.
#include <Arduino.h>
#include <SPI.h>

extern "C" {
#include "encoders.h"
#include "hal.h"
}

static_assert(sizeof(double) == 8, "this board has no doubles of 64 bits, which the controller computes with");

// ---- your board ----
static const int AXIS_SELECT = 10, WHEEL_A = 2, WHEEL_B = 3, BRIDGE_PWM = 9, BRIDGE_DIRECTION = 8,
                 BRIDGE_ENABLE = 7;
static const float SUPPLY = 12.0f;      // V at the bridge
static const float VOLTAGE_LIMIT = 10.0f;  // V, below the supply
static const int PWM_BITS = 10;
static const uint32_t RATE = 500;           // samples per second
static const uint32_t WHEEL_COUNTS = 8192;  // AMT103 at 2048 pulses per turn
// --------------------

#include "board_speed.h"
#include "board_watchdog.h"
#include "wheel.h"

// Bytes written unasked where a core never tells its room: a sample's telemetry of 38 and half of another, which leaves
// a line of 1 Mbaud empty again before the next sample.
static const int BLIND = 64;

// us between two feedings at least: a SAMD needs some ms to take one in, and waits for that at the next
static const uint32_t FEED_TIME = WATCHDOG_MS * 1000 / 4;
static_assert(1000000 / RATE <= FEED_TIME, "below 80 samples per second the watchdog needs more than 50 ms");

#if defined(ARDUINO_ARCH_ESP32)
static bool pwm_start() { return ledcAttach(BRIDGE_PWM, 20000, PWM_BITS); }
static void pwm_write(int duty) { ledcWrite(BRIDGE_PWM, (uint32_t)duty); }
#else
static bool pwm_start() {
    analogWriteResolution(PWM_BITS);
    return true;
}
static void pwm_write(int duty) { analogWrite(BRIDGE_PWM, duty); }
#endif

static int32_t axis;
static uint32_t due, fed;
static bool tells_room;  // whether availableForWrite() ever was above 0: Arduino's own Print says 0 in cores without it

extern "C" int hal_wait(void) {
    while ((int32_t)(micros() - due) < 0) {
    }
    if (micros() - due > 1000000 / RATE) due = micros();  // late: the guard sees it by the time of the readings
    due += 1000000 / RATE;
    if (micros() - fed >= FEED_TIME) {  // here alone: only who takes samples goes on
        fed = micros();
        watchdog_feed();
    }
    return 1;
}

extern "C" void hal_read(swingid_inputs *inputs) {
    uint16_t angle;
    SPI.beginTransaction(SPISettings(4000000, MSBFIRST, SPI_MODE1));
    for (int i = 0; i < 2; i++) {  // an answer belongs to the frame before
        digitalWrite(AXIS_SELECT, LOW);
        angle = SPI.transfer16(AS5048A_READ_ANGLE);
        digitalWrite(AXIS_SELECT, HIGH);
    }
    SPI.endTransaction();
    inputs->time = micros();
    inputs->valid = as5048a_angle(angle, &angle);
    if (inputs->valid) axis = swingid_extend(axis, angle, AS5048A_BITS);
    inputs->axis = axis;
    noInterrupts();
    inputs->wheel = wheel;
    interrupts();
    inputs->current = NAN;
}

extern "C" void hal_apply(float voltage, int armed) {
    const int full = (1 << PWM_BITS) - 1;
    const float size = voltage < 0.0f ? -voltage : voltage;
    digitalWrite(BRIDGE_DIRECTION, voltage < 0.0f ? LOW : HIGH);
    pwm_write((int)(size / SUPPLY * full + 0.5f));
    digitalWrite(BRIDGE_ENABLE, armed ? HIGH : LOW);
}

extern "C" int hal_receive(uint8_t *bytes, int room) {
    int count = 0;
    while (count < room && Serial.available() > 0) bytes[count++] = (uint8_t)Serial.read();
    return count;
}

extern "C" int hal_send(const uint8_t *bytes, int size) {
    const int free_bytes = Serial.availableForWrite();
    if (free_bytes > 0) tells_room = true;
    if (free_bytes > 0) return (int)Serial.write(bytes, (size_t)(size < free_bytes ? size : free_bytes));
    if (tells_room) return 0;  // it is full now
    return (int)Serial.write(bytes, (size_t)(size < BLIND ? size : BLIND));  // a core that always says 0
}

void setup() {
    digitalWrite(BRIDGE_PWM, LOW);
    digitalWrite(BRIDGE_DIRECTION, LOW);
    digitalWrite(BRIDGE_ENABLE, LOW);
    pinMode(BRIDGE_ENABLE, OUTPUT);
    pinMode(BRIDGE_PWM, OUTPUT);
    pinMode(BRIDGE_DIRECTION, OUTPUT);
    if (!watchdog_start() || !pwm_start()) {
        for (;;) {  // without a watchdog it does not run, and no host gets an answer
        }
    }
    hal_apply(0.0f, 0);
    pinMode(AXIS_SELECT, OUTPUT);
    digitalWrite(AXIS_SELECT, HIGH);
    wheel_start();
    SPI.begin();
    Serial.begin(1000000);
    watchdog_feed();
    due = fed = micros();
}

void loop() {
    swingid_config config = {(float)RATE, 1u << AS5048A_BITS, WHEEL_COUNTS, VOLTAGE_LIMIT, 0, MOST_ORDER, most_edges()};
    swingid_loop(&config);
}
