/* Bytes to messages and messages to bytes, as ../wire/wire.md says. */
#include "kappaskin_wire.h"

#include <string.h>

enum { MAGIC_0 = 0x4B, MAGIC_1 = 0xA7, HEADER_CHECK = 20 };

/* --- numbers, the lowest byte first */

uint8_t *kappaskin_put16(uint8_t *out, uint16_t value) {
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
    return out + 2;
}

uint8_t *kappaskin_put32(uint8_t *out, uint32_t value) {
    return kappaskin_put16(kappaskin_put16(out, (uint16_t)value), (uint16_t)(value >> 16));
}

uint8_t *kappaskin_put64(uint8_t *out, uint64_t value) {
    return kappaskin_put32(kappaskin_put32(out, (uint32_t)value), (uint32_t)(value >> 32));
}

uint16_t kappaskin_get16(const uint8_t *data) {
    return (uint16_t)(data[0] | (uint16_t)data[1] << 8);
}

uint32_t kappaskin_get32(const uint8_t *data) {
    return kappaskin_get16(data) | (uint32_t)kappaskin_get16(data + 2) << 16;
}

uint64_t kappaskin_get64(const uint8_t *data) {
    return kappaskin_get32(data) | (uint64_t)kappaskin_get32(data + 4) << 32;
}

/* --- runs */

uint8_t *kappaskin_put_runs(uint8_t *out, const struct kappaskin_run *runs, uint8_t number) {
    *out++ = number;
    for (unsigned n = 0; n < number; n++)
        out = kappaskin_put16(kappaskin_put16(out, runs[n].first), runs[n].length);
    return out;
}

int kappaskin_get_runs(const uint8_t *data, uint32_t length, struct kappaskin_run *runs) {
    if (length < 1 || length != 1u + (uint32_t)KAPPASKIN_RUN * data[0])
        return -1;
    for (unsigned n = 0; n < data[0]; n++) {
        const uint8_t *run = data + 1 + KAPPASKIN_RUN * n;
        runs[n].first = kappaskin_get16(run);
        runs[n].length = kappaskin_get16(run + 2);
    }
    return data[0];
}

/* --- checks, four bits at a time: tables of 16 fit any microcontroller */

uint16_t kappaskin_crc16(const uint8_t *data, uint32_t size) {
    static const uint16_t table[16] = {
        0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
        0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
    uint16_t crc = 0;
    for (uint32_t n = 0; n < size; n++) {
        crc = (uint16_t)(crc << 4) ^ table[(crc >> 12) ^ (data[n] >> 4)];
        crc = (uint16_t)(crc << 4) ^ table[(crc >> 12) ^ (data[n] & 15)];
    }
    return crc;
}

uint32_t kappaskin_crc32(const uint8_t *data, uint32_t size) {
    static const uint32_t table[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
        0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
        0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    uint32_t crc = 0xFFFFFFFFu;
    for (uint32_t n = 0; n < size; n++) {
        crc ^= data[n];
        crc = crc >> 4 ^ table[crc & 15];
        crc = crc >> 4 ^ table[crc & 15];
    }
    return ~crc;
}

/* --- out */

uint32_t kappaskin_size(const uint8_t *data) {
    return KAPPASKIN_ENVELOPE + kappaskin_get32(data + 4);
}

uint32_t kappaskin_seal(uint8_t *out, const struct kappaskin_message *message) {
    const uint32_t checked = KAPPASKIN_HEADER + message->length;
    out[0] = MAGIC_0;
    out[1] = MAGIC_1;
    out[2] = KAPPASKIN_VERSION;
    out[3] = message->kind;
    kappaskin_put32(out + 4, message->length);
    kappaskin_put32(out + 8, message->sequence);
    kappaskin_put64(out + 12, message->time);
    kappaskin_put16(out + HEADER_CHECK, kappaskin_crc16(out, HEADER_CHECK));
    kappaskin_put32(out + checked, kappaskin_crc32(out, checked));
    return checked + KAPPASKIN_CHECKSUM;
}

/* --- in */

void kappaskin_decoder_begin(struct kappaskin_decoder *decoder, uint8_t *buffer,
                             uint32_t capacity) {
    decoder->buffer = buffer;
    decoder->capacity = capacity;
    decoder->begin = decoder->end = 0;
}

uint32_t kappaskin_take(struct kappaskin_decoder *decoder, const uint8_t *data, uint32_t size) {
    const uint32_t unread = decoder->end - decoder->begin;
    if (decoder->begin) {
        memmove(decoder->buffer, decoder->buffer + decoder->begin, unread);
        decoder->begin = 0;
        decoder->end = unread;
    }
    const uint32_t room = decoder->capacity - decoder->end;
    const uint32_t taken = size < room ? size : room;
    if (taken)
        memcpy(decoder->buffer + decoder->end, data, taken);
    decoder->end += taken;
    return taken;
}

/* Drop bytes up to the next one that may begin a message. */
static void to_magic(struct kappaskin_decoder *decoder) {
    while (decoder->begin < decoder->end) {
        const uint8_t *at = decoder->buffer + decoder->begin;
        if (at[0] == MAGIC_0 && (decoder->end - decoder->begin < 2 || at[1] == MAGIC_1))
            return;
        decoder->begin++;
    }
}

static bool header_holds(const uint8_t *at) {
    return kappaskin_crc16(at, HEADER_CHECK) == kappaskin_get16(at + HEADER_CHECK);
}

static bool checksum_holds(const uint8_t *at, uint32_t checked) {
    return kappaskin_crc32(at, checked) == kappaskin_get32(at + checked);
}

/* The message at `at`; false for another version or a kind that this one does not have. */
static bool known(const uint8_t *at, struct kappaskin_message *message) {
    message->kind = at[3];
    message->length = kappaskin_get32(at + 4);
    message->sequence = kappaskin_get32(at + 8);
    message->time = kappaskin_get64(at + 12);
    message->payload = at + KAPPASKIN_HEADER;
    return at[2] == KAPPASKIN_VERSION && at[3] >= KAPPASKIN_INFORMATION_KIND &&
           at[3] <= KAPPASKIN_REPLY_KIND;
}

bool kappaskin_next(struct kappaskin_decoder *decoder, struct kappaskin_message *message) {
    for (to_magic(decoder); decoder->end - decoder->begin >= KAPPASKIN_HEADER; to_magic(decoder)) {
        const uint8_t *at = decoder->buffer + decoder->begin;
        const uint32_t length = kappaskin_get32(at + 4);
        if (!header_holds(at) || length > KAPPASKIN_LONGEST ||
            length > decoder->capacity - KAPPASKIN_ENVELOPE) {
            decoder->begin++;
            continue;
        }
        if (decoder->end - decoder->begin < KAPPASKIN_ENVELOPE + length)
            return false;
        if (!checksum_holds(at, KAPPASKIN_HEADER + length)) {
            decoder->begin++;
            continue;
        }
        decoder->begin += KAPPASKIN_ENVELOPE + length;
        if (known(at, message))
            return true;
    }
    return false;
}
