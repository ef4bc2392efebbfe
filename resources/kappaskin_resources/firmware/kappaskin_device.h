/* A skin's device: scans its channels, sends what they read, tells what it is, obeys its host.
 *
 * The board lends it seven functions and some memory, and calls `kappaskin_poll` again and again.
 * Nothing here waits: a message that does not fit into the outbox is dropped whole, and the number
 * spent on it tells the host. */
#ifndef KAPPASKIN_DEVICE_H
#define KAPPASKIN_DEVICE_H

#include "kappaskin_wire.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KAPPASKIN_NO_TEMPERATURE INT16_MIN
#define KAPPASKIN_LONGEST_INFORMATION 65536u

/* Bytes that a frame of so many channels takes at most, and an outbox that holds two. */
#define KAPPASKIN_FRAME(channels, count_bytes) \
    (2u + KAPPASKIN_RUNS * KAPPASKIN_RUN + (uint32_t)(channels) * (count_bytes))
#define KAPPASKIN_OUTBOX(channels, count_bytes) \
    (2u * (KAPPASKIN_ENVELOPE + KAPPASKIN_FRAME(channels, count_bytes)))

/* What the board does; each is handed `it`. Only `convert` may take its time. */
struct kappaskin_board {
    void *it;
    uint32_t (*microseconds)(void *it); /* begins again at 0 after the largest */
    int32_t (*convert)(void *it, uint16_t channel);
    uint32_t (*read)(void *it, uint8_t *data, uint32_t size); /* how many had come */
    uint32_t (*write)(void *it, const uint8_t *data, uint32_t size); /* how many it took */
    int16_t (*temperature)(void *it); /* in 0.01 degrees Celsius, or none */
    void (*light)(void *it, bool on);
    /* Thousandths of the gain, now in use; 0 where it cannot be, and nothing is changed. */
    uint32_t (*set_gain)(void *it, uint32_t thousandths);
};

struct kappaskin_setup {
    struct kappaskin_board board;
    uint16_t channels;
    uint8_t count_bytes;   /* 2 or 4 */
    uint32_t channel_time; /* ns from one channel to the next */
    char *information;     /* JSON; its rate and its gain are written anew */
    uint32_t information_room;
    uint8_t *frame; /* KAPPASKIN_FRAME bytes */
    uint32_t frame_room;
    uint8_t *outbox; /* holds any message; the more, the longer a host may be busy */
    uint32_t outbox_room;
};

struct kappaskin_device {
    struct kappaskin_setup has;
    uint64_t clock;    /* us since the start */
    uint32_t ticks;    /* of the board's counter, when the clock was last set by it */
    uint32_t sequence; /* of the next message */
    uint32_t spent;    /* messages made */
    uint32_t sent;     /* of these, handed to the board whole */

    struct kappaskin_decoder decoder;
    uint8_t incoming[KAPPASKIN_COMMAND];

    bool running;
    uint32_t rate; /* frames per 1000 s */
    uint64_t due;  /* us, when the next frame begins */
    uint32_t over; /* what a frame's time exceeds whole us by, summed up; in 1 / rate us */
    struct kappaskin_run runs[KAPPASKIN_RUNS];
    uint32_t listed; /* channels in the runs */

    bool scanning;
    uint32_t scans; /* begun */
    uint64_t began; /* us */
    uint8_t run;    /* the next channel to convert is in this run */
    uint16_t within;
    uint32_t head;   /* bytes of the frame before the first count */
    uint32_t filled; /* bytes of the frame */

    bool introduce; /* information is due at once */
    uint64_t introduced;
    bool lit;
    uint64_t dark; /* us, when the light goes out */

    uint32_t begin; /* what is not yet sent lies in the outbox from here */
    uint32_t end;   /* to here */
    uint32_t left;  /* bytes left of a message that is partly sent */
};

/* NULL, or why this setup cannot be used. The device is then running, at its highest rate. */
const char *kappaskin_begin(struct kappaskin_device *device, const struct kappaskin_setup *setup);

/* Do what is due. Returns after some 300 us; must be called at least once an hour. */
void kappaskin_poll(struct kappaskin_device *device);

/* Write a number into the information, which is sent soon; false where it has no such key. */
bool kappaskin_tell(struct kappaskin_device *device, const char *key, uint32_t thousandths);

/* Throw away what a host that has gone did not take or say whole. */
void kappaskin_forget(struct kappaskin_device *device);

#ifdef __cplusplus
}
#endif
#endif
