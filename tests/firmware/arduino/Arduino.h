/* As much of Arduino's and Teensy's interface as the sketches use, on boards that answer with the
 * address on their pins. */
#pragma once

#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum { LOW, HIGH, OUTPUT = 1, A0 = 14, A9 = 23, MSBFIRST = 1 };

#define HW_OCOTP_MAC0 0xFF012345u

void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
void digitalWriteFast(uint8_t pin, uint8_t value);
void analogReadResolution(unsigned bits);
int analogRead(uint8_t pin);
void delayNanoseconds(uint32_t ns);
void delay(uint32_t ms);
void delayMicroseconds(unsigned us);
uint32_t micros();
unsigned long millis();

struct Usb {
    void begin(long baud);
    int available();
    int read();
    int availableForWrite();
    size_t write(const uint8_t *data, size_t size);
    void print(char sign);
    void print(int number);
    void print(unsigned long number);
    void println();
    void println(const char *text);
};

extern Usb Serial;
