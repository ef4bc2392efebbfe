/* A device on a board of numbers, in a time of its own: commands on standard input to the bytes that
 * it sends on standard output, and what it counted on standard error.
 *
 *     device_driver run CHANNELS COUNT_BYTES CHANNEL_TIME OUTBOX TAKEN TICKS POLLS
 *     device_driver set KEY VALUE ROOM
 *     device_driver thousandths NUMBER
 *
 * A poll begins with 10 us of nothing, and each channel takes CHANNEL_TIME ns; the board's counter
 * begins at TICKS, and it takes TAKEN bytes in a poll. */
#include "device_json.h"
#include "kappaskin_device.h"
#include "kappaskin_text.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct numbers {
    uint64_t ns;
    uint32_t channel_time, ticks, taken, room;
    uint32_t gain, lights;
    uint16_t most;
};

static uint32_t microseconds(void *it) {
    const struct numbers *board = it;
    return board->ticks + (uint32_t)(board->ns / 1000);
}

static int32_t convert(void *it, uint16_t channel) {
    struct numbers *board = it;
    board->ns += board->channel_time;
    if (channel > board->most)
        exit(3);
    return 1 - 2 * (int32_t)channel;
}

static uint32_t read_some(void *it, uint8_t *data, uint32_t size) {
    (void)it;
    return (uint32_t)fread(data, 1, size, stdin);
}

static uint32_t write_some(void *it, const uint8_t *data, uint32_t size) {
    struct numbers *board = it;
    const uint32_t taken = size < board->room ? size : board->room;
    board->room -= taken;
    return (uint32_t)fwrite(data, 1, taken, stdout);
}

static int16_t temperature(void *it) {
    (void)it;
    return KAPPASKIN_NO_TEMPERATURE;
}

static void light(void *it, bool on) {
    struct numbers *board = it;
    board->lights = 2 * board->lights + on;
}

static uint32_t set_gain(void *it, uint32_t thousandths) {
    struct numbers *board = it;
    return thousandths == 10000 || thousandths == 100000 ? board->gain = thousandths : 0;
}

static uint32_t word(char **words, int place) {
    return (uint32_t)strtoul(words[place], NULL, 10);
}

static int run(char **words) {
    const uint32_t channels = word(words, 0), count_bytes = word(words, 1);
    struct kappaskin_device *device = malloc(sizeof *device);
    struct numbers board = {0};
    struct kappaskin_setup setup = {0};
    const struct kappaskin_board seam = {&board,     microseconds, convert, read_some,
                                         write_some, temperature,  light,   set_gain};
    board.channel_time = word(words, 2);
    board.taken = word(words, 4);
    board.ticks = word(words, 5);
    board.most = (uint16_t)(channels - 1);
    setup.board = seam;
    setup.channels = (uint16_t)channels;
    setup.count_bytes = (uint8_t)count_bytes;
    setup.channel_time = board.channel_time;
    setup.information_room = sizeof KAPPASKIN_DEVICE_JSON + 24;
    setup.information = malloc(setup.information_room);
    strcpy(setup.information, KAPPASKIN_DEVICE_JSON);
    setup.frame_room = KAPPASKIN_FRAME(channels, count_bytes);
    setup.frame = malloc(setup.frame_room);
    setup.outbox_room = word(words, 3);
    setup.outbox = malloc(setup.outbox_room);
    const char *why = kappaskin_begin(device, &setup);
    for (uint32_t n = 0; !why && n < word(words, 6); n++) {
        board.ns += 10000;
        board.room = board.taken;
        kappaskin_poll(device);
    }
    if (why)
        fprintf(stderr, "%s\n", why);
    else
        fprintf(stderr,
                "{\"spent\": %" PRIu32 ", \"sent\": %" PRIu32 ", \"scans\": %" PRIu32
                ", \"rate\": %" PRIu32 ", \"lights\": %" PRIu32 ", \"ns\": %" PRIu64
                ", \"waiting\": %" PRIu32 ", \"scanning\": %d}\n",
                device->spent, device->sent, device->scans, device->rate, board.lights, board.ns,
                device->end - device->begin, device->scanning);
    free(setup.outbox);
    free(setup.frame);
    free(setup.information);
    free(device);
    return why ? 2 : 0;
}

static int set(char **words) {
    const uint32_t room = word(words, 2);
    char *text = calloc(1, room);
    const size_t got = fread(text, 1, room - 1, stdin);
    const bool done = kappaskin_set_value(text, room, words[0], words[1]);
    printf("%s", text);
    free(text);
    return done && got ? 0 : 2;
}

int main(int count, char **words) {
    char number[KAPPASKIN_NUMBER];
    if (count == 9 && !strcmp(words[1], "run"))
        return run(words + 2);
    if (count == 5 && !strcmp(words[1], "set"))
        return set(words + 2);
    kappaskin_thousandths(number, word(words, 2));
    puts(number);
    return 0;
}
