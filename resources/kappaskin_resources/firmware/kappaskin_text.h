/* Numbers to text, and into a JSON text, without a printf or floating point. */
#ifndef KAPPASKIN_TEXT_H
#define KAPPASKIN_TEXT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { KAPPASKIN_NUMBER = 12 }; /* characters of the longest number, and the zero behind it */

/* `value` / 1000 as JSON writes it, e.g. 166.666 or 100, with a zero behind it. */
void kappaskin_thousandths(char out[KAPPASKIN_NUMBER], uint32_t value);

/* Put `value` for what the first `key` of the JSON in `text` has, a number, a text or a list of
 * such; `room` is what the place of `text` holds. False where there is no such key or no room. */
bool kappaskin_set_value(char *text, uint32_t room, const char *key, const char *value);

#ifdef __cplusplus
}
#endif
#endif
