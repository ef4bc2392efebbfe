/* The part of a device that goes through its channels, and the clock it does that by. */
#ifndef KAPPASKIN_SCAN_H
#define KAPPASKIN_SCAN_H

#include "kappaskin_device.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Set the clock by the board's counter. */
void kappaskin_keep_time(struct kappaskin_device *device);

/* Frames per 1000 s that so many channels allow at most. */
uint32_t kappaskin_highest_rate(const struct kappaskin_device *device, uint32_t channels);

/* Begin a frame at once, and others at `rate` after it. */
void kappaskin_pace(struct kappaskin_device *device, uint32_t rate);

/* Scan these channels from the next frame on; all of them for no runs. */
void kappaskin_list(struct kappaskin_device *device, const struct kappaskin_run *runs,
                    uint8_t number);

/* Convert what is due, for a while; true when that completes the frame. */
bool kappaskin_scan(struct kappaskin_device *device);

#ifdef __cplusplus
}
#endif
#endif
