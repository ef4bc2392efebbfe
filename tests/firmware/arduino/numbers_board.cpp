/* A board for the sketch that prints numbers: each channel reads 500 and ten times its number. */
#include "Arduino.h"

#include <stdlib.h>

void setup();
void loop();

static bool driven[64], high[64];
static unsigned long us, chosen;
static bool begun;

static void must(bool right, const char *what) {
    if (right)
        return;
    fprintf(stderr, "expected %s\n", what);
    exit(3);
}

void pinMode(uint8_t pin, uint8_t mode) {
    driven[pin] = mode == OUTPUT;
}

void digitalWrite(uint8_t pin, uint8_t value) {
    must(driven[pin] && pin >= 2 && pin <= 5, "an address pin that is an output");
    high[pin] = value != 0;
    chosen = us;
}

int analogRead(uint8_t pin) {
    must(pin == A0 && us - chosen >= 10, "a voltage on A0 that has settled");
    us += 100;
    return 500 + 10 * (high[2] + 2 * high[3] + 4 * high[4] + 8 * high[5]);
}

void delayMicroseconds(unsigned time) {
    us += time;
}

unsigned long millis() {
    return us / 1000;
}

void Usb::begin(long baud) {
    must(baud == 115200, "the baud rate of board.toml");
    begun = true;
}

void Usb::print(char sign) {
    must(begun, "a port that is open");
    putchar(sign);
}

void Usb::print(int number) {
    printf("%d", number);
}

void Usb::print(unsigned long number) {
    printf("%lu", number);
}

void Usb::println() {
    puts("\r");
}

Usb Serial;

int main() {
    setup();
    for (int frame = 0; frame < 50; frame++)
        loop();
    return 0;
}
