/* The part of a device that does what its host asks for. */
#ifndef KAPPASKIN_COMMANDS_H
#define KAPPASKIN_COMMANDS_H

#include "kappaskin_device.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The data that a command asked for, or why it was not done. */
struct kappaskin_answer {
    enum kappaskin_status status;
    uint8_t data[KAPPASKIN_REASON];
    uint32_t size;
};

/* Do the command of `length` bytes, one at least, and fill an empty `answer`. */
void kappaskin_do(struct kappaskin_device *device, const uint8_t *command, uint32_t length,
                  struct kappaskin_answer *answer);

#ifdef __cplusplus
}
#endif
#endif
