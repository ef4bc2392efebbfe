/* Numbers to text, and into a JSON text. */
#include "kappaskin_text.h"

#include <string.h>

void kappaskin_thousandths(char out[KAPPASKIN_NUMBER], uint32_t value) {
    char digits[KAPPASKIN_NUMBER]; /* the last one first */
    unsigned number = 0, dropped = 0;
    for (; number < 4 || value; value /= 10)
        digits[number++] = (char)('0' + value % 10);
    while (dropped < 3 && digits[dropped] == '0')
        dropped++;
    while (number > dropped) {
        *out++ = digits[--number];
        if (number == 3 && dropped < 3)
            *out++ = '.';
    }
    *out = 0;
}

static char *after_space(char *at) {
    return at + strspn(at, " \t\r\n");
}

/* Where the value of `key` begins; NULL where there is no such key. */
static char *value_of(char *text, const char *key) {
    const size_t length = strlen(key);
    for (char *at = strchr(text, '"'); at; at = strchr(at + 1, '"')) {
        if (strncmp(at + 1, key, length) || at[1 + length] != '"')
            continue;
        char *colon = after_space(at + length + 2);
        if (*colon == ':')
            return after_space(colon + 1);
    }
    return NULL;
}

static const char *end_of_text(const char *at) {
    for (at++; *at && *at != '"'; at++)
        if (*at == '\\' && at[1])
            at++;
    return *at ? at + 1 : at;
}

static const char *end_of_value(const char *at) {
    if (*at == '"')
        return end_of_text(at);
    if (*at == '[')
        return at + strcspn(at, "]") + (strchr(at, ']') ? 1 : 0);
    return at + strcspn(at, ",]} \t\r\n");
}

bool kappaskin_set_value(char *text, uint32_t room, const char *key, const char *value) {
    char *at = value_of(text, key);
    if (!at)
        return false;
    const char *end = end_of_value(at);
    const size_t rest = strlen(end) + 1, length = strlen(value);
    if ((size_t)(at - text) + length + rest > room)
        return false;
    memmove(at + length, end, rest);
    memcpy(at, value, length);
    return true;
}
