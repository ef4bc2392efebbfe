// A Kappaskin device on a Teensy 4.0 or 4.1, with the board that README.md beside this folder wires.
#include <Arduino.h>
#include <SPI.h>

#include "device_json.h"
#include "kappaskin_device.h"
#include "kappaskin_text.h"

// --- what another skin or another board changes, besides device.json

static const uint16_t CHANNELS = 300;
static const uint32_t CHANNEL_TIME = 10000;  // ns, all told: device.json has it in two parts
static const uint32_t SETTLING = 6500;       // ns from choosing a channel to holding its voltage
static const uint32_t CONVERSION = 1600;     // ns, the converter's longest
static const uint16_t PARKED = 15 << 5;      // a bank without elements, with a load like theirs

static const uint8_t ADDRESS[] = {2, 3, 4, 5, 6, 7, 8, 9, 14};  // lowest bit first
static const uint8_t CONVERT = 10;
static const uint8_t GAIN[] = {15, 16};
static const uint8_t LIGHT = 17;
static const uint8_t THERMOMETER = A9;

// --- the board

static void choose(uint16_t address) {
    for (unsigned bit = 0; bit < sizeof ADDRESS; bit++)
        digitalWriteFast(ADDRESS[bit], address >> bit & 1);
}

static uint32_t board_microseconds(void *) {
    return micros();
}

static int32_t board_convert(void *, uint16_t channel) {
    choose(channel);
    delayNanoseconds(SETTLING);
    digitalWriteFast(CONVERT, HIGH);  // it holds its input here
    delayNanoseconds(CONVERSION);
    digitalWriteFast(CONVERT, LOW);
    return (int32_t)SPI.transfer16(0) - 32768;
}

static uint32_t board_read(void *, uint8_t *data, uint32_t size) {
    uint32_t got = 0;
    while (got < size && Serial.available() > 0)
        data[got++] = (uint8_t)Serial.read();
    return got;
}

static uint32_t board_write(void *, const uint8_t *data, uint32_t size) {
    const int room = Serial.availableForWrite();  // a longer write would wait for a host
    if (room <= 0)
        return 0;
    return Serial.write(data, size < (uint32_t)room ? size : (uint32_t)room);
}

// A TMP36: 0.5 V at 0 degrees, and 10 mV each.
static int16_t board_temperature(void *) {
    const int32_t millivolts = (int32_t)analogRead(THERMOMETER) * 3300 / 4095;
    return (int16_t)((millivolts - 500) * 10);
}

static void board_light(void *, bool on) {
    digitalWriteFast(LIGHT, on);
}

static uint32_t board_set_gain(void *, uint32_t thousandths) {
    if (thousandths != 10000 && thousandths != 100000)
        return 0;
    digitalWriteFast(GAIN[0], thousandths == 10000);
    digitalWriteFast(GAIN[1], thousandths == 100000);
    return thousandths;
}

// --- the device

static const uint32_t OUTBOX = 65536;  // 0.3 s of all channels at the highest rate

static struct kappaskin_device device;
static char information[sizeof KAPPASKIN_DEVICE_JSON + 64];
static uint8_t frame[KAPPASKIN_FRAME(CHANNELS, 2)];
static uint8_t outbox[OUTBOX];
static const char *why;  // it cannot run; NULL where it can

static void set_pins() {
    for (unsigned bit = 0; bit < sizeof ADDRESS; bit++)
        pinMode(ADDRESS[bit], OUTPUT);
    pinMode(CONVERT, OUTPUT);
    pinMode(GAIN[0], OUTPUT);
    pinMode(GAIN[1], OUTPUT);
    pinMode(LIGHT, OUTPUT);
    analogReadResolution(12);
    SPI.begin();
    SPI.beginTransaction(SPISettings(20000000, MSBFIRST, SPI_MODE0));
}

// The number that USB tells too, so that a port and what it says are known to be one board.
static void set_serial_number() {
    char text[16];
    uint32_t number = HW_OCOTP_MAC0 & 0xFFFFFF;
    if (number < 10000000)
        number *= 10;
    snprintf(text, sizeof text, "\"%lu\"", (unsigned long)number);
    if (!kappaskin_set_value(information, sizeof information, "serial_number", text))
        why = "expected a serial_number in device.json";
}

void setup() {
    struct kappaskin_setup setup;
    memset(&setup, 0, sizeof setup);
    memcpy(information, KAPPASKIN_DEVICE_JSON, sizeof KAPPASKIN_DEVICE_JSON);
    set_pins();
    board_set_gain(NULL, 100000);
    set_serial_number();
    setup.board.microseconds = board_microseconds;
    setup.board.convert = board_convert;
    setup.board.read = board_read;
    setup.board.write = board_write;
    setup.board.temperature = board_temperature;
    setup.board.light = board_light;
    setup.board.set_gain = board_set_gain;
    setup.channels = CHANNELS;
    setup.count_bytes = 2;
    setup.channel_time = CHANNEL_TIME;
    setup.information = information;
    setup.information_room = sizeof information;
    setup.frame = frame;
    setup.frame_room = sizeof frame;
    setup.outbox = outbox;
    setup.outbox_room = sizeof outbox;
    Serial.begin(2000000);  // USB goes as fast as it can
    if (!why)
        why = kappaskin_begin(&device, &setup);
}

void loop() {
    if (why) {
        Serial.println(why);
        delay(1000);
        return;
    }
    kappaskin_poll(&device);
    // A bank left on between two frames would be the warmest.
    if (!device.scanning)
        choose(PARKED);
}
