// A board that prints one line for each frame: milliseconds, then the readings of all channels,
// with commas between them. board.toml beside this file describes it:
//     kappaskin app --source /dev/ttyACM0 --sensor board.toml
// The amplified bridges are on a 74HC4067 multiplexer: its address on pins 2 to 5, its output on A0.
#include <Arduino.h>

static const uint8_t CHANNELS = 12;  // xx of elements 0 to 3, then yy, then xy
static const uint8_t ADDRESS[] = {2, 3, 4, 5};
static const unsigned SETTLING = 20;  // us from choosing a channel to reading it

void setup() {
    Serial.begin(115200);
    for (uint8_t pin : ADDRESS)
        pinMode(pin, OUTPUT);
}

static int reading(uint8_t channel) {
    for (uint8_t bit = 0; bit < sizeof ADDRESS; bit++)
        digitalWrite(ADDRESS[bit], channel >> bit & 1);
    delayMicroseconds(SETTLING);
    return analogRead(A0);
}

void loop() {
    Serial.print(millis());
    for (uint8_t channel = 0; channel < CHANNELS; channel++) {
        Serial.print(',');
        Serial.print(reading(channel));
    }
    Serial.println();
}
