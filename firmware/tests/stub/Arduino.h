/* The declarations that the sketch uses, to compile it without an Arduino core. */
#pragma once
#include <math.h>
#include <stddef.h>
#include <stdint.h>
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
