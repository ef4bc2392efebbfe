/* Bytes on standard input to a line for each message in them, and messages to bytes.
 *
 *     wire_driver decode CAPACITY CHUNK    prints the messages, then how many bytes wait
 *     wire_driver lines CAPACITY           the same for each line: chunks in hex with spaces between
 *     wire_driver seal KIND SEQUENCE TIME  prints the message around the bytes
 *     wire_driver runs                     prints the runs read, and written anew */
#include "kappaskin_wire.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint8_t *standard_input(uint32_t *size) {
    uint32_t room = 1u << 16;
    uint8_t *data = malloc(room);
    size_t got;
    *size = 0;
    while (data && (got = fread(data + *size, 1, room - *size, stdin)) > 0) {
        *size += (uint32_t)got;
        if (*size == room)
            data = realloc(data, room *= 2);
    }
    return data;
}

static void print_hex(const uint8_t *data, uint32_t size) {
    for (uint32_t n = 0; n < size; n++)
        printf("%02x", data[n]);
}

static void print_messages(struct kappaskin_decoder *decoder) {
    struct kappaskin_message message;
    while (kappaskin_next(decoder, &message)) {
        printf("%u %" PRIu32 " %" PRIu64 " ", message.kind, message.sequence, message.time);
        print_hex(message.payload, message.length);
        putchar('\n');
    }
}

static void feed(struct kappaskin_decoder *decoder, const uint8_t *data, uint32_t size) {
    while (size) {
        const uint32_t taken = kappaskin_take(decoder, data, size);
        if (!taken)
            exit(3); /* it would take nothing for ever */
        print_messages(decoder);
        data += taken;
        size -= taken;
    }
}

static void print_waiting(const struct kappaskin_decoder *decoder) {
    printf("waiting %" PRIu32 "\n", decoder->end - decoder->begin);
}

static int decode(const uint8_t *data, uint32_t size, uint32_t capacity, uint32_t chunk) {
    struct kappaskin_decoder decoder;
    uint8_t *buffer = malloc(capacity);
    kappaskin_decoder_begin(&decoder, buffer, capacity);
    for (uint32_t at = 0; at < size; at += chunk)
        feed(&decoder, data + at, size - at < chunk ? size - at : chunk);
    print_waiting(&decoder);
    free(buffer);
    return 0;
}

static uint8_t digit(uint8_t letter) {
    return (uint8_t)(letter <= '9' ? letter - '0' : letter - 'a' + 10);
}

/* A chunk in hex, made bytes in its own place; where it ends. */
static uint32_t fed_chunk(struct kappaskin_decoder *decoder, uint8_t *data, uint32_t at) {
    uint8_t *out = data + at;
    uint32_t size = 0;
    for (; data[at] > ' '; at += 2)
        out[size++] = (uint8_t)(digit(data[at]) << 4 | digit(data[at + 1]));
    feed(decoder, out, size);
    return at;
}

static int lines(uint8_t *data, uint32_t size, uint32_t capacity) {
    struct kappaskin_decoder decoder;
    uint8_t *buffer = malloc(capacity);
    kappaskin_decoder_begin(&decoder, buffer, capacity);
    for (uint32_t at = 0; at < size; at++) {
        at = fed_chunk(&decoder, data, at);
        if (data[at] == '\n') {
            print_waiting(&decoder);
            kappaskin_decoder_begin(&decoder, buffer, capacity);
        }
    }
    free(buffer);
    return 0;
}

static int seal(const uint8_t *payload, uint32_t size, char **words) {
    struct kappaskin_message message = {0};
    uint8_t *out = malloc(KAPPASKIN_ENVELOPE + size);
    memcpy(out + KAPPASKIN_HEADER, payload, size);
    message.kind = (uint8_t)atoi(words[0]);
    message.sequence = (uint32_t)strtoul(words[1], NULL, 10);
    message.time = strtoull(words[2], NULL, 10);
    message.length = size;
    const uint32_t whole = kappaskin_seal(out, &message);
    print_hex(out, whole);
    printf("\n%d\n", whole == kappaskin_size(out));
    free(out);
    return 0;
}

static int runs(const uint8_t *data, uint32_t size) {
    struct kappaskin_run found[KAPPASKIN_RUNS];
    uint8_t out[1 + KAPPASKIN_RUNS * KAPPASKIN_RUN];
    const int number = kappaskin_get_runs(data, size, found);
    for (int n = 0; n < number; n++)
        printf("%u %u\n", found[n].first, found[n].length);
    if (number >= 0)
        print_hex(out, (uint32_t)(kappaskin_put_runs(out, found, (uint8_t)number) - out));
    printf("\n%d\n", number);
    return 0;
}

int main(int argc, char **argv) {
    uint32_t size;
    uint8_t *data = standard_input(&size);
    int code = 2;
    if (argc == 4 && !strcmp(argv[1], "decode"))
        code = decode(data, size, (uint32_t)atoi(argv[2]), (uint32_t)atoi(argv[3]));
    else if (argc == 3 && !strcmp(argv[1], "lines"))
        code = lines(data, size, (uint32_t)atoi(argv[2]));
    else if (argc == 5 && !strcmp(argv[1], "seal"))
        code = seal(data, size, argv + 2);
    else if (argc == 2 && !strcmp(argv[1], "runs"))
        code = runs(data, size);
    free(data);
    return code;
}
