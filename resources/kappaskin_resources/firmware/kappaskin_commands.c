/* Commands to answers, and to what they change. */
#include "kappaskin_commands.h"

#include "kappaskin_scan.h"
#include "kappaskin_text.h"

#include <string.h>

enum { IDENTIFIED = 2000000 /* us that the light is on */ };

/* --- the commands */

static void say(struct kappaskin_answer *answer, const char *text) {
    const size_t length = strlen(text), room = sizeof answer->data - answer->size;
    const size_t said = length < room ? length : room;
    memcpy(answer->data + answer->size, text, said);
    answer->size += (uint32_t)said;
}

static void refuse(struct kappaskin_answer *answer, enum kappaskin_status status, const char *reason) {
    answer->status = status;
    answer->size = 0;
    say(answer, reason);
}

static void give32(struct kappaskin_answer *answer, uint32_t value) {
    answer->size = (uint32_t)(kappaskin_put32(answer->data, value) - answer->data);
}

static void hello(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                  struct kappaskin_answer *answer) {
    (void)device, (void)size;
    if (arguments[0] > KAPPASKIN_VERSION || arguments[1] < KAPPASKIN_VERSION) {
        refuse(answer, KAPPASKIN_NO_COMMON_VERSION, "this device speaks version 1");
        return;
    }
    answer->data[0] = KAPPASKIN_VERSION;
    answer->size = 1;
}

static void start(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                  struct kappaskin_answer *answer) {
    (void)arguments, (void)size, (void)answer;
    if (!device->running)
        kappaskin_pace(device, device->rate);
    device->running = true;
}

static void stop(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                 struct kappaskin_answer *answer) {
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
                      struct kappaskin_answer *answer) {
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
    kappaskin_list(device, runs, (uint8_t)number);
    const uint32_t most = kappaskin_highest_rate(device, device->listed);
    kappaskin_pace(device, device->rate < most ? device->rate : most);
}

static void take_rate(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                      struct kappaskin_answer *answer) {
    const uint32_t rate = kappaskin_get32(arguments);
    const uint32_t most = kappaskin_highest_rate(device, device->listed);
    (void)size;
    if (!rate || rate > most) {
        char number[KAPPASKIN_NUMBER];
        kappaskin_thousandths(number, most);
        refuse(answer, KAPPASKIN_OUT_OF_RANGE, "expected a rate above zero and up to ");
        say(answer, number);
        say(answer, " frames/s with the channels listed");
        return;
    }
    kappaskin_pace(device, rate);
    give32(answer, rate);
}

static void take_gain(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                      struct kappaskin_answer *answer) {
    const struct kappaskin_board *board = &device->has.board;
    const uint32_t gain = board->set_gain(board->it, kappaskin_get32(arguments));
    (void)size;
    if (!gain) {
        refuse(answer, KAPPASKIN_OUT_OF_RANGE, "expected a gain that this amplifier has");
        return;
    }
    /* No frame is of two gains. */
    device->scanning = false;
    kappaskin_tell(device, "gain", gain);
    give32(answer, gain);
}

static void identify(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                     struct kappaskin_answer *answer) {
    (void)arguments, (void)size, (void)answer;
    device->introduce = device->lit = true;
    device->dark = device->clock + IDENTIFIED;
    device->has.board.light(device->has.board.it, true);
}

static void ping(struct kappaskin_device *device, const uint8_t *arguments, uint32_t size,
                 struct kappaskin_answer *answer) {
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
    void (*done)(struct kappaskin_device *, const uint8_t *, uint32_t, struct kappaskin_answer *);
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

void kappaskin_do(struct kappaskin_device *device, const uint8_t *command, uint32_t length,
                       struct kappaskin_answer *answer) {
    const uint32_t place = command[0] - 1u, size = length - 1;
    if (place >= sizeof operations / sizeof *operations)
        refuse(answer, KAPPASKIN_UNKNOWN_OPERATION, "expected an operation from 1 to 8");
    else if (operations[place].size != ANY && operations[place].size != size)
        refuse(answer, KAPPASKIN_WRONG_LENGTH, operations[place].expected);
    else
        operations[place].done(device, command + 1, size, answer);
}
