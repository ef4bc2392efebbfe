/* Channels to a frame, each in its time. */
#include "kappaskin_scan.h"

#include <string.h>

enum {
    BLOCK = 16,     /* channels between two looks at the clock */
    SLICE = 250,    /* us that conversions may take, and a block more */
    LATEST = 100000 /* us that frames may be late and are still made up for */
};

void kappaskin_keep_time(struct kappaskin_device *device) {
    const uint32_t ticks = device->has.board.microseconds(device->has.board.it);
    device->clock += (uint32_t)(ticks - device->ticks);
    device->ticks = ticks;
}

uint32_t kappaskin_highest_rate(const struct kappaskin_device *device, uint32_t channels) {
    const uint64_t most = UINT64_C(1000000000000) / ((uint64_t)channels * device->has.channel_time);
    return most < UINT32_MAX ? (uint32_t)most : UINT32_MAX;
}

void kappaskin_pace(struct kappaskin_device *device, uint32_t rate) {
    device->rate = rate;
    device->due = device->clock;
    device->over = 0;
    device->scanning = false;
}

static void make_due(struct kappaskin_device *device) {
    const uint32_t time = 1000000000u;
    device->due += time / device->rate;
    device->over += time % device->rate;
    if (device->over >= device->rate) {
        device->over -= device->rate;
        device->due++;
    }
    if (device->clock > device->due + LATEST)
        device->due = device->clock;
}

void kappaskin_list(struct kappaskin_device *device, const struct kappaskin_run *runs,
                    uint8_t number) {
    const struct kappaskin_run all = {0, device->has.channels};
    uint8_t *frame = device->has.frame;
    if (!number) {
        runs = &all;
        number = 1;
    }
    memcpy(device->runs, runs, number * sizeof *runs);
    device->listed = 0;
    for (unsigned n = 0; n < number; n++)
        device->listed += runs[n].length;
    frame[0] = device->has.count_bytes;
    device->head = (uint32_t)(kappaskin_put_runs(frame + 1, runs, number) - frame);
}

static void begin_scan(struct kappaskin_device *device) {
    device->scanning = true;
    device->scans++;
    device->began = device->clock;
    device->run = 0;
    device->within = 0;
    device->filled = device->head;
}

static void convert_next(struct kappaskin_device *device) {
    const struct kappaskin_run *run = &device->runs[device->run];
    const struct kappaskin_board *board = &device->has.board;
    const uint16_t channel = (uint16_t)(run->first + device->within);
    const uint32_t count = (uint32_t)board->convert(board->it, channel);
    uint8_t *out = device->has.frame + device->filled;
    if (device->has.count_bytes == 2)
        kappaskin_put16(out, (uint16_t)count);
    else
        kappaskin_put32(out, count);
    device->filled += device->has.count_bytes;
    if (++device->within == run->length) {
        device->within = 0;
        device->run++;
    }
}

static bool complete(const struct kappaskin_device *device) {
    return device->filled == device->head + device->listed * device->has.count_bytes;
}

bool kappaskin_scan(struct kappaskin_device *device) {
    const uint64_t from = device->clock;
    if (!device->running || (!device->scanning && device->clock < device->due))
        return false;
    if (!device->scanning)
        begin_scan(device);
    while (!complete(device) && device->clock - from < SLICE) {
        for (unsigned n = 0; n < BLOCK && !complete(device); n++)
            convert_next(device);
        kappaskin_keep_time(device);
    }
    if (!complete(device))
        return false;
    device->scanning = false;
    make_due(device);
    return true;
}
