/* Readings and commands to messages: the loop of a device. */
#include "kappaskin_device.h"

#include "kappaskin_commands.h"
#include "kappaskin_scan.h"
#include "kappaskin_text.h"

#include <string.h>

enum {
    READ = 256,            /* bytes of commands taken in a poll */
    INTRODUCTION = 500000, /* us between two informations */
    REPLY = 6              /* bytes of a reply before its data */
};

/* --- what is sent */

/* A place in the outbox for a message, NULL where it does not fit. */
static uint8_t *room_for(struct kappaskin_device *device, uint32_t size) {
    const uint32_t waiting = device->end - device->begin;
    if (size > device->has.outbox_room - waiting)
        return NULL;
    if (size > device->has.outbox_room - device->end) {
        memmove(device->has.outbox, device->has.outbox + device->begin, waiting);
        device->begin = 0;
        device->end = waiting;
    }
    return device->has.outbox + device->end;
}

static void post(struct kappaskin_device *device, enum kappaskin_kind kind, uint64_t time,
                 const uint8_t *payload, uint32_t length) {
    const struct kappaskin_message message = {(uint8_t)kind, device->sequence++, time, payload,
                                              length};
    uint8_t *out = room_for(device, KAPPASKIN_ENVELOPE + length);
    device->spent++;
    if (!out)
        return;
    memcpy(out + KAPPASKIN_HEADER, payload, length);
    device->end += kappaskin_seal(out, &message);
}

/* Count the messages that end in the next `size` bytes of the outbox, and leave these behind. */
static void sent(struct kappaskin_device *device, uint32_t size) {
    while (size) {
        if (!device->left)
            device->left = kappaskin_size(device->has.outbox + device->begin);
        const uint32_t step = size < device->left ? size : device->left;
        device->begin += step;
        device->left -= step;
        size -= step;
        if (!device->left)
            device->sent++;
    }
}

static void drain(struct kappaskin_device *device) {
    const struct kappaskin_board *board = &device->has.board;
    uint32_t taken = 1;
    while (taken && device->begin < device->end) {
        const uint32_t waiting = device->end - device->begin;
        taken = board->write(board->it, device->has.outbox + device->begin, waiting);
        sent(device, taken < waiting ? taken : waiting);
    }
    if (device->begin == device->end)
        device->begin = device->end = 0;
}

static void introduce(struct kappaskin_device *device) {
    if (!device->introduce && device->clock - device->introduced < INTRODUCTION)
        return;
    device->introduce = false;
    device->introduced = device->clock;
    post(device, KAPPASKIN_INFORMATION_KIND, device->clock,
         (const uint8_t *)device->has.information, (uint32_t)strlen(device->has.information));
}

bool kappaskin_tell(struct kappaskin_device *device, const char *key, uint32_t thousandths) {
    char number[KAPPASKIN_NUMBER];
    kappaskin_thousandths(number, thousandths);
    device->introduce = true;
    return kappaskin_set_value(device->has.information, device->has.information_room, key, number);
}

/* --- what is heard */

static void reply(struct kappaskin_device *device, const struct kappaskin_message *message) {
    struct kappaskin_answer answer = {KAPPASKIN_DONE, {0}, 0};
    uint8_t payload[REPLY + KAPPASKIN_REASON];
    if (message->kind != KAPPASKIN_COMMAND_KIND || !message->length)
        return;
    kappaskin_do(device, message->payload, message->length, &answer);
    kappaskin_put32(payload, message->sequence);
    payload[4] = message->payload[0];
    payload[5] = (uint8_t)answer.status;
    memcpy(payload + REPLY, answer.data, answer.size);
    post(device, KAPPASKIN_REPLY_KIND, device->clock, payload, REPLY + answer.size);
}

static void obey(struct kappaskin_device *device) {
    uint8_t data[READ];
    struct kappaskin_message message;
    const uint32_t size = device->has.board.read(device->has.board.it, data, READ);
    kappaskin_keep_time(device); /* a ping came before this, and after the last */
    for (uint32_t at = 0; at < size;) {
        at += kappaskin_take(&device->decoder, data + at, size - at);
        while (kappaskin_next(&device->decoder, &message))
            reply(device, &message);
    }
}

/* --- the device */

static void dim(struct kappaskin_device *device) {
    if (!device->lit || device->clock < device->dark)
        return;
    device->lit = false;
    device->has.board.light(device->has.board.it, false);
}

void kappaskin_poll(struct kappaskin_device *device) {
    obey(device);
    dim(device);
    introduce(device);
    if (kappaskin_scan(device))
        post(device, KAPPASKIN_SAMPLES_KIND, device->began, device->has.frame, device->filled);
    drain(device);
}

void kappaskin_forget(struct kappaskin_device *device) {
    device->begin = device->end = device->left = 0;
    device->introduce = true;
    kappaskin_decoder_begin(&device->decoder, device->incoming, sizeof device->incoming);
}

static const char *unusable(const struct kappaskin_setup *setup) {
    const uint32_t frame = KAPPASKIN_FRAME(setup->channels, setup->count_bytes);
    const size_t text = strlen(setup->information) + 2 * KAPPASKIN_NUMBER;
    if (!setup->channels || !setup->channel_time)
        return "expected a channel at least, and the time that one takes";
    if (setup->count_bytes != 2 && setup->count_bytes != 4)
        return "expected 2 or 4 bytes per count";
    if (setup->frame_room < frame || frame > KAPPASKIN_LONGEST)
        return "expected a frame of KAPPASKIN_FRAME bytes, and no more than a message may have";
    if (setup->information_room < text || text > KAPPASKIN_LONGEST_INFORMATION)
        return "expected room for the information and 24 bytes more";
    if (setup->outbox_room < KAPPASKIN_ENVELOPE + (frame > text ? frame : text))
        return "expected an outbox that holds the frame, and the information";
    return NULL;
}

const char *kappaskin_begin(struct kappaskin_device *device, const struct kappaskin_setup *setup) {
    const char *why = unusable(setup);
    if (why)
        return why;
    memset(device, 0, sizeof *device);
    device->has = *setup;
    device->ticks = setup->board.microseconds(setup->board.it);
    device->running = true;
    kappaskin_forget(device);
    kappaskin_list(device, NULL, 0);
    kappaskin_pace(device, kappaskin_highest_rate(device, setup->channels));
    if (!device->rate)
        return "expected a channel time that lets a frame be done in 1000 s";
    if (!kappaskin_tell(device, "rate", device->rate))
        return "expected information with a rate";
    return NULL;
}
