/* The wire format of ../wire/wire.md, version 1: bytes to messages and messages to bytes.
 *
 * No heap, no floating point, no operating system; nothing here waits. The caller lends every
 * buffer. One context at a time may use a decoder or write a message. */
#ifndef KAPPASKIN_WIRE_H
#define KAPPASKIN_WIRE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    KAPPASKIN_VERSION = 1,
    KAPPASKIN_HEADER = 22, /* bytes before the payload */
    KAPPASKIN_CHECKSUM = 4, /* bytes after it */
    KAPPASKIN_ENVELOPE = KAPPASKIN_HEADER + KAPPASKIN_CHECKSUM,
    KAPPASKIN_RUNS = 255, /* the most runs in a message */
    KAPPASKIN_RUN = 4, /* bytes of one */
    KAPPASKIN_REASON = 200, /* bytes of why a command was not done */
    /* The longest command there is: a scan list. */
    KAPPASKIN_COMMAND = KAPPASKIN_ENVELOPE + 2 + KAPPASKIN_RUNS * KAPPASKIN_RUN
};

#define KAPPASKIN_LONGEST 262144u /* bytes of payload */
#define KAPPASKIN_CHANNELS 65536u /* that a run can name */

enum kappaskin_kind {
    KAPPASKIN_INFORMATION_KIND = 1,
    KAPPASKIN_SAMPLES_KIND = 2,
    KAPPASKIN_COMMAND_KIND = 3,
    KAPPASKIN_REPLY_KIND = 4
};

enum kappaskin_operation {
    KAPPASKIN_HELLO = 1,
    KAPPASKIN_START = 2,
    KAPPASKIN_STOP = 3,
    KAPPASKIN_SCAN_LIST = 4,
    KAPPASKIN_RATE = 5,
    KAPPASKIN_GAIN = 6,
    KAPPASKIN_IDENTIFY = 7,
    KAPPASKIN_PING = 8
};

enum kappaskin_status {
    KAPPASKIN_DONE = 0,
    KAPPASKIN_UNKNOWN_OPERATION = 1,
    KAPPASKIN_WRONG_LENGTH = 2,
    KAPPASKIN_OUT_OF_RANGE = 3,
    KAPPASKIN_NO_COMMON_VERSION = 4,
    KAPPASKIN_NOT_NOW = 5
};

/* A message whose checks held; `payload` lies in the decoder's buffer until it takes more bytes. */
struct kappaskin_message {
    uint8_t kind;
    uint32_t sequence;
    uint64_t time; /* us on the sender's clock */
    const uint8_t *payload;
    uint32_t length;
};

/* Channels `first` to `first + length - 1`. */
struct kappaskin_run {
    uint16_t first;
    uint16_t length;
};

/* Bytes that came and are not yet read; lives in a buffer of `capacity` bytes that is lent to it,
 * and passes over what is longer. */
struct kappaskin_decoder {
    uint8_t *buffer;
    uint32_t capacity;
    uint32_t begin; /* what is not yet read lies from here */
    uint32_t end;   /* to here */
};

void kappaskin_decoder_begin(struct kappaskin_decoder *decoder, uint8_t *buffer, uint32_t capacity);

/* How many of `size` bytes it took; the others must be offered again, once the messages are read. */
uint32_t kappaskin_take(struct kappaskin_decoder *decoder, const uint8_t *data, uint32_t size);

/* The next whole message, or false where more bytes must come first. Ask until it says false. */
bool kappaskin_next(struct kappaskin_decoder *decoder, struct kappaskin_message *message);

/* Bytes of the message around the `message->length` bytes of payload that the caller has put at
 * `out + KAPPASKIN_HEADER`: writes header and checksum. `message->payload` is not looked at. */
uint32_t kappaskin_seal(uint8_t *out, const struct kappaskin_message *message);

/* Bytes that the message whose header is at `data` has in all. */
uint32_t kappaskin_size(const uint8_t *data);

/* What is written next goes behind what these have put there. */
uint8_t *kappaskin_put16(uint8_t *out, uint16_t value);
uint8_t *kappaskin_put32(uint8_t *out, uint32_t value);
uint8_t *kappaskin_put64(uint8_t *out, uint64_t value);
uint8_t *kappaskin_put_runs(uint8_t *out, const struct kappaskin_run *runs, uint8_t number);

uint16_t kappaskin_get16(const uint8_t *data);
uint32_t kappaskin_get32(const uint8_t *data);
uint64_t kappaskin_get64(const uint8_t *data);

/* How many runs were read, into a place for KAPPASKIN_RUNS; -1 where `length` is not what so many
 * runs take. Whether a run makes sense is for the caller to say. */
int kappaskin_get_runs(const uint8_t *data, uint32_t length, struct kappaskin_run *runs);

uint16_t kappaskin_crc16(const uint8_t *data, uint32_t size);
uint32_t kappaskin_crc32(const uint8_t *data, uint32_t size);

#ifdef __cplusplus
}
#endif
#endif
