/* The declarations that the sketch uses, to compile it without an Arduino core; board.cpp has what they do. */
#pragma once
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#define F_CPU 84000000
enum { LOW, HIGH, OUTPUT, INPUT_PULLUP, CHANGE, MSBFIRST, SPI_MODE1 };
void pinMode(int, int);
void digitalWrite(int, int);
int digitalRead(int);
void analogWrite(int, int);
void analogWriteResolution(int);
int digitalPinToInterrupt(int);
void attachInterrupt(int, void (*)(), int);
void noInterrupts();
void interrupts();
uint32_t micros();
struct SerialPort {
    void begin(unsigned long);
    int available();
    int read();
    int availableForWrite();
    size_t write(const uint8_t *, size_t);
};
extern SerialPort Serial;
void setup();
void loop();
#if defined(ARDUINO_ARCH_SAM)
void watchdogEnable(uint32_t);
void watchdogReset();
void watchdogSetup();
#elif defined(ARDUINO_ARCH_ESP32)
#define IRAM_ATTR
bool ledcAttach(uint8_t, uint32_t, uint8_t);
bool ledcWrite(uint8_t, uint32_t);
#endif
