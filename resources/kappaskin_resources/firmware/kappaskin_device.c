/* Readings and commands to messages: the loop of a device. */
#include "kappaskin_device.h"

#include "kappaskin_text.h"

#include <string.h>

enum {
    READ = 256,             /* bytes of commands taken in a poll */
    BLOCK = 16,             /* channels between two looks at the clock */
    SLICE = 250,            /* us of a poll that conversions may take, and a block more */
    LATEST = 100000,        /* us that frames may be late and are still made up for */
    INTRODUCTION = 500000,  /* us between two informations */
    IDENTIFIED = 2000000,   /* us that the light is on */
    REPLY = 6               /* bytes of a reply before its data */
};

/* Why a command was not done, or the data that it asked for. */
struct answer {
    enum kappaskin_status status;
    uint8_t data[KAPPASKIN_REASON];
    uint32_t size;
};

static void keep_time(struct kappaskin_device *device) {
    const uint32_t ticks = device->has.board.microseconds(device->has.board.it);
    device->clock += (uint32_t)(ticks - device->ticks);
    device->ticks = ticks;
}

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

/* --- the scan */

/* Frames per 1000 s that so many channels allow at most. */
static uint32_t highest_rate(const struct kappaskin_device *device, uint32_t channels) {
    const uint64_t most = UINT64_C(1000000000000) / ((uint64_t)channels * device->has.channel_time);
    return most < UINT32_MAX ? (uint32_t)most : UINT32_MAX;
}

/* Begin a frame at once, and others at `rate` after it. */
static void pace(struct kappaskin_device *device, uint32_t rate) {
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

static void list(struct kappaskin_device *device, const struct kappaskin_run *runs,
                 uint8_t number) {
    uint8_t *frame = device->has.frame;
    memmove(device->runs, runs, number * sizeof *runs);
    device->number_of_runs = number;
    device->listed = 0;
    for (unsigned n = 0; n < number; n++)
        device->listed += runs[n].length;
    frame[0] = device->has.count_bytes;
    device->head = (uint32_t)(kappaskin_put_runs(frame + 1, device->runs, number) - frame);
}

static void list_all(struct kappaskin_device *device) {
    const struct kappaskin_run all = {0, device->has.channels};
    list(device, &all, 1);
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

static void scan(struct kappaskin_device *device) {
    const uint64_t from = device->clock;
    if (!device->running || (!device->scanning && device->clock < device->due))
        return;
    if (!device->scanning)
        begin_scan(device);
    while (!complete(device) && device->clock - from < SLICE) {
        for (unsigned n = 0; n < BLOCK && !complete(device); n++)
            convert_next(device);
        keep_time(device);
    }
    if (complete(device)) {
        post(device, KAPPASKIN_SAMPLES_KIND, device->began, device->has.frame, device->filled);
        device->scanning = false;
        make_due(device);
    }
}

/* --- the commands */

static void say(struct answer *answer, const char *text) {
    const size_t length = strlen(text), room = sizeof answer->data - answer->size;
    const size_t said = length < room ? length : room;
    memcpy(answer->data + answer->size, text, said);
    answer->size += (uint32_t)said;
}

static void refuse(struct answer *answer, enum kappaskin_status status, const char *reason) {
    answer->status = status;
    answer->size = 0;
    say(answer, reason);
}

static void give32(struct answer *answer, uint32_t value) {
    answer->size = (uint32_t)(kappaskin_put32(answer->data, value) - answer->data);
}

static void hello(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                  struct answer *answer) {
    (void)device, (void)size;
    if (arguments[0] > KAPPASKIN_VERSION || arguments[1] < KAPPASKIN_VERSION) {
        refuse(answer, KAPPASKIN_NO_COMMON_VERSION, "this device speaks version 1");
        return;
    }
    answer->data[0] = KAPPASKIN_VERSION;
    answer->size = 1;
}

static void start(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                  struct answer *answer) {
    (void)arguments, (void)size, (void)answer;
    if (!device->running)
        pace(device, device->rate);
    device->running = true;
}

static void stop(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                 struct answer *answer) {
    (void)arguments, (void)size, (void)answer;
    device->running = device->scanning = false;
}

static bool apart(const struct kappaskin_run *one, const struct kappaskin_run *other) {
    return one->first + one->length <= other->first || other->first + other->length <= one->first;
}

/* What is wrong with a list, NULL for nothing. */
static const char *wrong_with(const struct kappaskin_run *runs, int number, uint32_t channels) {
    for (int n = 0; n < number; n++) {
        if (!runs[n].length)
            return "expected runs of at least one channel";
        if ((uint32_t)runs[n].first + runs[n].length > channels)
            return "expected channels that this device has; its information tells how many";
        for (int earlier = 0; earlier < n; earlier++)
            if (!apart(&runs[n], &runs[earlier]))
                return "expected every channel once";
    }
    return NULL;
}

static void take_list(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                      struct answer *answer) {
    struct kappaskin_run runs[KAPPASKIN_RUNS];
    const int number = kappaskin_get_runs(arguments, size, runs);
    if (number < 0) {
        refuse(answer, KAPPASKIN_WRONG_LENGTH,
               "expected the number of runs, then first channel and length of each");
        return;
    }
    const char *wrong = wrong_with(runs, number, device->has.channels);
    if (wrong) {
        refuse(answer, KAPPASKIN_OUT_OF_RANGE, wrong);
        return;
    }
    if (number)
        list(device, runs, (uint8_t)number);
    else
        list_all(device);
    const uint32_t most = highest_rate(device, device->listed);
    pace(device, device->rate < most ? device->rate : most);
}

static void take_rate(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                      struct answer *answer) {
    const uint32_t rate = kappaskin_get32(arguments), most = highest_rate(device, device->listed);
    (void)size;
    if (!rate || rate > most) {
        char number[KAPPASKIN_NUMBER];
        kappaskin_thousandths(number, most);
        refuse(answer, KAPPASKIN_OUT_OF_RANGE, "expected a rate above zero and up to ");
        say(answer, number);
        say(answer, " frames/s with the channels listed");
        return;
    }
    pace(device, rate);
    give32(answer, rate);
}

/* Write a number into the information; false where it has no such key. */
static bool tell(struct kappaskin_device *device, const char *key, uint32_t thousandths) {
    char number[KAPPASKIN_NUMBER];
    kappaskin_thousandths(number, thousandths);
    device->introduce = true;
    return kappaskin_set_value(device->has.information, device->has.information_room, key, number);
}

static void take_gain(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                      struct answer *answer) {
    const struct kappaskin_board *board = &device->has.board;
    const uint32_t gain = board->set_gain(board->it, kappaskin_get32(arguments));
    (void)size;
    if (!gain) {
        refuse(answer, KAPPASKIN_OUT_OF_RANGE, "expected a gain that this amplifier has");
        return;
    }
    /* No frame is of two gains. */
    device->scanning = false;
    tell(device, "gain", gain);
    give32(answer, gain);
}

static void identify(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                     struct answer *answer) {
    (void)arguments, (void)size, (void)answer;
    device->introduce = device->lit = true;
    device->dark = device->clock + IDENTIFIED;
    device->has.board.light(device->has.board.it, true);
}

static void ping(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                 struct answer *answer) {
    const uint16_t temperature = (uint16_t)device->has.board.temperature(device->has.board.it);
    (void)arguments, (void)size;
    uint8_t *end = kappaskin_put16(kappaskin_put64(answer->data, device->clock), temperature);
    answer->size = (uint32_t)(end - answer->data);
}

enum { ANY = UINT16_MAX };

/* By operation, from 1 on: bytes of arguments, what they are, and what is done. */
static const struct {
    uint16_t size;
    const char *expected;
    void (*done)(struct kappaskin_device *, const uint8_t *, uint32_t, struct answer *);
} operations[] = {
    {2, "expected the lowest and the highest version, a byte each", hello},
    {0, "expected no arguments", start},
    {0, "expected no arguments", stop},
    {ANY, "", take_list},
    {4, "expected frames per 1000 s in 4 bytes", take_rate},
    {4, "expected thousandths of the gain in 4 bytes", take_gain},
    {0, "expected no arguments", identify},
    {0, "expected no arguments", ping},
};

static void do_command(struct kappaskin_device *device, const uint8_t *command, uint32_t length,
                       struct answer *answer) {
    const uint32_t place = command[0] - 1u, size = length - 1;
    if (place >= sizeof operations / sizeof *operations)
        refuse(answer, KAPPASKIN_UNKNOWN_OPERATION, "expected an operation from 1 to 8");
    else if (operations[place].size != ANY && operations[place].size != size)
        refuse(answer, KAPPASKIN_WRONG_LENGTH, operations[place].expected);
    else
        operations[place].done(device, command + 1, size, answer);
}

static void reply(struct kappaskin_device *device, const struct kappaskin_message *message) {
    struct answer answer = {KAPPASKIN_DONE, {0}, 0};
    uint8_t payload[REPLY + KAPPASKIN_REASON];
    if (message->kind != KAPPASKIN_COMMAND_KIND || !message->length)
        return;
    do_command(device, message->payload, message->length, &answer);
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
    keep_time(device); /* a ping came before this, and after the last */
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
    scan(device);
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
    list_all(device);
    pace(device, highest_rate(device, setup->channels));
    if (!device->rate)
        return "expected a channel time that lets a frame be done in 1000 s";
    if (!tell(device, "rate", device->rate))
        return "expected information with a rate";
    return NULL;
}
