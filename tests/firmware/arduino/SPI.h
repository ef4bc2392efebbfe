/* As much of Arduino's SPI as the sketch uses. */
#pragma once

#include <stdint.h>

enum { SPI_MODE0 };

struct SPISettings {
    SPISettings(uint32_t clock, uint8_t order, uint8_t mode);
};

struct Bus {
    void begin();
    void beginTransaction(SPISettings settings);
    uint16_t transfer16(uint16_t data);
};

extern Bus SPI;
