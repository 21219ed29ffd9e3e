// What an edge of the wheel costs an Arduino with an AVR: the sketch's interrupt with the core's own dispatch, in cycles
// of timer 1, said on the serial port; the program makes the edges itself. Last the number of edges that were counted.
#include <Arduino.h>

static const int WHEEL_A = 2, WHEEL_B = 3;
#include "wheel.h"

#if defined(__AVR_ATmega2560__)
#define PORT_D2_D3(name) name##E
enum { A_BIT = 4, B_BIT = 5 };
#else
#define PORT_D2_D3(name) name##D
enum { A_BIT = 2, B_BIT = 3 };
#endif

static void say(unsigned number) {
    char digits[6];
    int count = 0;
    do digits[count++] = (char)('0' + number % 10);
    while (number /= 10);
    while (count >= 0) {
        while (!(UCSR0A & 1 << UDRE0)) {
        }
        UDR0 = count > 0 ? digits[count - 1] : '\n';
        count--;
    }
}

int main() {
    TCCR1A = 0;
    TCCR1B = 1;  // a count a cycle
    UCSR0B = 1 << TXEN0;
    wheel_start();
    PORT_D2_D3(DDR) |= 1 << A_BIT | 1 << B_BIT;
    sei();
    for (int edge = 0; edge < 8; edge++) {
        const unsigned before = TCNT1;
        PORT_D2_D3(PIN) = edge % 2 ? 1 << B_BIT : 1 << A_BIT;  // its level changes
        __asm__ volatile("nop\n\tnop\n\tnop\n\tnop");
        const unsigned after = TCNT1;
        say(after - before);
    }
    say((unsigned)(wheel < 0 ? -wheel : wheel));
    cli();
    __asm__ volatile("sleep");
}
