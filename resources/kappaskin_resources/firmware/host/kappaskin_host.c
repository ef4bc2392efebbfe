/* A device on a pseudo-terminal: the firmware with this machine for its board.
 *
 * Prints one JSON line with the port, then serves until stopped (Ctrl+C); then tells on standard
 * error what became of its messages. It is quiet until someone opens the port, and again after they
 * close it. Options, each with a value:
 *
 *     --rate R            frames/s of all channels; what the electronics allow where left out
 *     --grid MxN          elements along x and y; or --channels N for those that are in no grid
 *     --frames N          end after so many
 *     --information FILE  what the device says it is, instead of the reference board's
 *     --counts FILE       frames of signed counts of 16 bits, played round and round
 *     --serial TEXT       its serial number        --firmware TEXT    its version
 *     --sequence N        of its first message     --clock-offset US  its clock when it starts
 *     --clock-ppm N       by what its clock is fast
 *     --pty-link PATH     a link to the port, there while it is plugged in
 *     --unplug-every MS   it is unplugged so often, as on SIGUSR1; goes on, and says it to nobody
 *     --away MS           for so long; 500 where left out
 */
#define _XOPEN_SOURCE 700

#include "device_json.h"
#include "kappaskin_device.h"
#include "kappaskin_text.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum {
    OUTBOX = 1 << 20, /* bytes */
    STEPS = 256,      /* frames of the pattern, in which its contact goes round once */
    ROUND = 4,        /* s that this takes */
    QUIET = 20,       /* ms between two looks for a listener */
    LONGEST_NAP = 50, /* ms */
    LINGER = 300,     /* ms for a listener to take what it was sent */
    REFUSED = 2
};

struct options {
    const char *rate, *grid, *channels, *frames, *information, *counts, *serial, *firmware;
    const char *sequence, *clock_offset, *clock_ppm, *pty_link, *unplug_every, *away;
};

struct host {
    struct kappaskin_device device;
    struct kappaskin_setup setup;
    int line; /* -1 while unplugged */
    char port[64];
    const char *link;
    bool listened;
    uint64_t begun;           /* ns */
    int64_t ppm;
    const int16_t *counts;    /* frames of all channels, one after the other */
    uint32_t frames;          /* that there are of them */
    uint32_t round;           /* scans in which they are played once */
    const int16_t *shown;     /* the frame that is being scanned */
    uint32_t shown_scan;
    uint32_t gain, first_gain;
    uint32_t unplugged;
    uint64_t plug_time;       /* ms, when it is next unplugged or plugged in; 0 for never */
    uint64_t unplug_every, away;
};

static volatile sig_atomic_t stopped, pulled;

static void refuse(const char *format, ...) {
    va_list values;
    va_start(values, format);
    fputs("kappaskin_host: ", stderr);
    vfprintf(stderr, format, values);
    fputc('\n', stderr);
    va_end(values);
    exit(REFUSED);
}

/* --- options and files */

static const char **place_of(struct options *options, const char *name) {
    const struct {
        const char *name, **place;
    } known[] = {
        {"--rate", &options->rate},           {"--grid", &options->grid},
        {"--channels", &options->channels},   {"--frames", &options->frames},
        {"--information", &options->information}, {"--counts", &options->counts},
        {"--serial", &options->serial},       {"--firmware", &options->firmware},
        {"--sequence", &options->sequence},   {"--clock-offset", &options->clock_offset},
        {"--clock-ppm", &options->clock_ppm}, {"--pty-link", &options->pty_link},
        {"--unplug-every", &options->unplug_every}, {"--away", &options->away},
    };
    for (size_t n = 0; n < sizeof known / sizeof *known; n++)
        if (!strcmp(name, known[n].name))
            return known[n].place;
    return NULL;
}

static struct options read_options(int count, char **words) {
    struct options options = {0};
    for (int n = 1; n < count; n += 2) {
        const char **place = place_of(&options, words[n]);
        if (!place)
            refuse("there is no option %s; the first lines of kappaskin_host.c name all", words[n]);
        else if (n + 1 == count)
            refuse("expected a value after %s", words[n]);
        else
            *place = words[n + 1];
    }
    return options;
}

/* The number in `text`, `otherwise` where there is none. */
static double number(const char *what, const char *text, double low, double high,
                     double otherwise) {
    char *end;
    if (!text)
        return otherwise;
    const double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        refuse("expected %s from %.15g to %.15g, got %s", what, low, high, text);
    return value;
}

/* What the file holds, with a zero behind it. */
static char *contents(const char *path, size_t *size) {
    FILE *file = fopen(path, "rb");
    char *data = NULL;
    size_t room = 0, got = 1;
    *size = 0;
    if (!file)
        refuse("%s: cannot be read (%s)", path, strerror(errno));
    while (got) {
        if (*size + 1 >= room && !(data = realloc(data, room = 2 * room + 65536)))
            refuse("%s: too large for the memory there is", path);
        got = fread(data + *size, 1, room - *size - 1, file);
        *size += got;
    }
    fclose(file);
    data[*size] = 0;
    return data;
}

static int64_t at_most(int64_t value, int64_t limit) {
    return value < -limit ? -limit : value > limit ? limit : value;
}

/* 1, 0, -1, 0 and back in `period` steps, in straight lines, times `size`. */
static int64_t swing(uint32_t step, uint32_t period, int64_t size) {
    const int64_t along = (int64_t)(step % period) * 4;
    const int64_t whole = period;
    if (along < 2 * whole)
        return size * (whole - along) / whole;
    return size * (along - 3 * whole) / whole;
}

/* The count of a reading at (x, y) from a contact, in sixteenths of a pitch: the second derivatives
 * of a dent w = 1 / (1 + r^2 / W). */
static int16_t dented(uint32_t component, int64_t x, int64_t y) {
    const int64_t W = 40 * 40, whole = W + x * x + y * y;
    const int64_t parts[] = {whole - 4 * x * x, whole - 4 * y * y, -4 * x * y};
    int64_t count = 8000 * 256 * parts[component] / whole;
    count = count * W / whole;
    count = count * W / whole;
    return (int16_t)at_most(count / 256, INT16_MAX);
}

/* A contact that goes round on a grid of m x n. */
static const int16_t *pattern(uint32_t m, uint32_t n) {
    const uint32_t elements = m * n;
    int16_t *counts = malloc((size_t)STEPS * 3 * elements * sizeof *counts);
    if (!counts)
        refuse("no memory for a grid of %" PRIu32 " x %" PRIu32, m, n);
    for (uint32_t at = 0, step = 0; step < STEPS; step++) {
        const int64_t x = 8 * (int64_t)m + swing(step, STEPS, 4 * (int64_t)m);
        const int64_t y = 8 * (int64_t)n + swing(step + STEPS / 4, STEPS, 4 * (int64_t)n);
        for (uint32_t component = 0; component < 3; component++)
            for (uint32_t p = 0; p < elements; p++)
                counts[at++] = dented(component, 16 * (int64_t)(p % m) + 8 - x,
                                      16 * (int64_t)(p / m) + 8 - y);
    }
    return counts;
}

static void play(struct host *host, const char *path) {
    size_t size;
    int16_t *counts = (int16_t *)(void *)contents(path, &size);
    const size_t frame = 2 * (size_t)host->setup.channels;
    if (!size || size % frame)
        refuse("%s: expected frames of %zu bytes, got %zu bytes", path, frame, size);
    for (size_t n = 0; n < size / 2; n++)
        counts[n] = (int16_t)kappaskin_get16((const uint8_t *)&counts[n]);
    host->counts = counts;
    host->frames = host->round = (uint32_t)(size / frame);
}

/* --- the board */

static uint64_t now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint64_t)time.tv_sec * 1000000000u + (uint64_t)time.tv_nsec;
}

static uint32_t board_microseconds(void *it) {
    const struct host *host = it;
    const int64_t us = (int64_t)((now() - host->begun) / 1000);
    return (uint32_t)(us + us * host->ppm / 1000000);
}

static void show(struct host *host) {
    const uint32_t scan = host->device.scans - 1;
    const uint64_t frame = (uint64_t)(scan % host->round) * host->frames / host->round;
    host->shown = host->counts + frame * host->setup.channels;
    host->shown_scan = host->device.scans;
}

static int32_t board_convert(void *it, uint16_t channel) {
    struct host *host = it;
    if (host->shown_scan != host->device.scans)
        show(host);
    const int32_t count = host->shown[channel];
    if (host->gain == host->first_gain)
        return count;
    return (int32_t)at_most((int64_t)count * host->gain / host->first_gain, INT16_MAX);
}

static uint32_t board_read(void *it, uint8_t *data, uint32_t size) {
    const struct host *host = it;
    const ssize_t got = host->line < 0 ? 0 : read(host->line, data, size);
    return got < 0 ? 0 : (uint32_t)got;
}

static uint32_t board_write(void *it, const uint8_t *data, uint32_t size) {
    const struct host *host = it;
    const ssize_t taken = host->line < 0 ? 0 : write(host->line, data, size);
    return taken < 0 ? 0 : (uint32_t)taken;
}

static int16_t board_temperature(void *it) {
    (void)it;
    return 2345;
}

static void board_light(void *it, bool on) {
    (void)it, (void)on;
}

static uint32_t board_set_gain(void *it, uint32_t thousandths) {
    struct host *host = it;
    if (thousandths < 1000 || thousandths > 1000000)
        return 0;
    return host->gain = thousandths;
}

/* --- the port */

static bool hung_up(const struct host *host) {
    struct pollfd line = {host->line, POLLOUT, 0};
    return poll(&line, 1, 0) > 0 && (line.revents & POLLHUP);
}

static void make_raw(const char *port) {
    struct termios mode;
    const int line = open(port, O_RDWR | O_NOCTTY);
    if (line < 0 || tcgetattr(line, &mode))
        refuse("%s: cannot be set up (%s)", port, strerror(errno));
    mode.c_iflag = 0;
    mode.c_oflag = 0;
    mode.c_lflag = 0;
    mode.c_cflag = CS8 | CREAD | CLOCAL;
    mode.c_cc[VMIN] = 1;
    mode.c_cc[VTIME] = 0;
    tcsetattr(line, TCSANOW, &mode);
    close(line); /* with no other holder of this end, a hang-up says that nobody listens */
}

/* Throw away what was written just after the last listener closed: the next one is greeted first. */
static void clear_unread(const char *port) {
    const int line = open(port, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (line < 0)
        return;
    tcflush(line, TCIFLUSH);
    close(line);
}

static void put_link(const struct host *host) {
    struct stat found;
    if (!host->link)
        return;
    if (!lstat(host->link, &found) && !S_ISLNK(found.st_mode))
        refuse("%s: expected nothing there, or a link; choose another place", host->link);
    unlink(host->link);
    if (symlink(host->port, host->link))
        refuse("%s: cannot be made (%s)", host->link, strerror(errno));
}

static void plug_in(struct host *host) {
    host->line = posix_openpt(O_RDWR | O_NOCTTY);
    if (host->line < 0 || grantpt(host->line) || unlockpt(host->line))
        refuse("no pseudo-terminal can be made (%s)", strerror(errno));
    snprintf(host->port, sizeof host->port, "%s", ptsname(host->line));
    make_raw(host->port);
    fcntl(host->line, F_SETFL, O_NONBLOCK);
    put_link(host);
    kappaskin_forget(&host->device);
    host->listened = false;
}

static void pull_out(struct host *host) {
    if (host->link)
        unlink(host->link);
    close(host->line);
    host->line = -1;
    host->unplugged++;
}

static uint64_t milliseconds(void) {
    return now() / 1000000;
}

/* Plug in or pull out, where that is due. */
static void plug(struct host *host) {
    const bool due = host->plug_time && milliseconds() >= host->plug_time;
    if (host->line < 0 && due) {
        plug_in(host);
        host->plug_time = host->unplug_every ? milliseconds() + host->unplug_every : 0;
    } else if (host->line >= 0 && (due || pulled)) {
        pull_out(host);
        host->plug_time = milliseconds() + host->away;
    }
    pulled = 0;
}

/* --- the loop */

static void nap(const struct host *host, bool listening, uint64_t us) {
    const struct kappaskin_device *device = &host->device;
    const struct timespec longest = {(time_t)(us / 1000000), (long)(us % 1000000) * 1000};
    const bool waiting = listening && device->begin < device->end;
    sigset_t none;
    fd_set read, written;
    FD_ZERO(&read);
    FD_ZERO(&written);
    if (listening)
        FD_SET(host->line, &read);
    if (waiting)
        FD_SET(host->line, &written);
    sigemptyset(&none);
    pselect(listening ? host->line + 1 : 0, &read, &written, NULL, &longest, &none);
}

/* us until something is due. */
static uint64_t idle(const struct kappaskin_device *device) {
    if (device->scanning)
        return 0;
    if (!device->running)
        return LONGEST_NAP * 1000;
    const uint64_t left = device->due > device->clock ? device->due - device->clock : 0;
    return left < LONGEST_NAP * 1000 ? left : LONGEST_NAP * 1000;
}

static void serve(struct host *host, uint32_t frames) {
    struct kappaskin_device *device = &host->device;
    while (!stopped) {
        plug(host);
        if (host->line >= 0 && hung_up(host)) {
            if (host->listened) {
                clear_unread(host->port);
                kappaskin_forget(device);
            }
            host->listened = false;
            nap(host, false, QUIET * 1000);
            continue;
        }
        host->listened = host->line >= 0;
        kappaskin_poll(device);
        if (frames && device->scans >= frames && !device->scanning) {
            device->running = false;
            if (device->begin == device->end)
                break;
        }
        const uint64_t left = idle(device);
        if (left)
            nap(host, host->listened, left);
    }
}

static void on_signal(int got) {
    if (got == SIGUSR1)
        pulled = 1;
    else
        stopped = 1;
}

/* They come only while we nap, so that none is missed before one. */
static void hold_signals(void) {
    const int numbers[] = {SIGINT, SIGTERM, SIGUSR1};
    struct sigaction action = {0};
    sigset_t held;
    sigemptyset(&held);
    action.sa_handler = on_signal;
    for (size_t n = 0; n < sizeof numbers / sizeof *numbers; n++) {
        sigaddset(&held, numbers[n]);
        sigaction(numbers[n], &action, NULL);
    }
    sigprocmask(SIG_BLOCK, &held, NULL);
}

/* --- the setup */

/* The number that `key` of the information has, or the next one of its list. */
static double told_number(const char *text, const char *key, int place) {
    char quoted[64];
    double numbers[2];
    snprintf(quoted, sizeof quoted, "\"%s\"", key);
    const char *at = strstr(text, quoted);
    if (at)
        at += strlen(quoted);
    if (!at || sscanf(at + strspn(at, " \t\r\n:["), "%lf , %lf", numbers, numbers + 1) <= place)
        refuse("expected information with a number for %s; compare device.json", key);
    return numbers[place] >= 0 && numbers[place] <= 1e9 ? numbers[place] : 0;
}

static void change(struct host *host, const char *key, const char *value) {
    if (!kappaskin_set_value(host->setup.information, host->setup.information_room, key, value))
        refuse("expected information with %s", key);
}

static void change_text(struct host *host, const char *key, const char *value) {
    char quoted[128];
    if (!value)
        return;
    if (strpbrk(value, "\"\\\n\r\t") || strlen(value) > sizeof quoted - 3)
        refuse("expected a short %s without quotes and backslashes, got %s", key, value);
    snprintf(quoted, sizeof quoted, "\"%s\"", value);
    change(host, key, quoted);
}

static void take_information(struct host *host, const struct options *options) {
    size_t size = sizeof KAPPASKIN_DEVICE_JSON - 1;
    const char *text = KAPPASKIN_DEVICE_JSON;
    if (options->information)
        text = contents(options->information, &size);
    host->setup.information_room = (uint32_t)(size < 65536 ? size : 65536) + 512;
    host->setup.information = calloc(1, host->setup.information_room);
    if (size > 65536)
        refuse("%s: expected at most 65536 bytes, got %zu", options->information, size);
    memcpy(host->setup.information, text, size);
    change_text(host, "serial_number", options->serial);
    change_text(host, "firmware", options->firmware);
}

/* Elements along x and y; those of no grid lie in a row. */
static void take_grid(struct host *host, const struct options *options, uint32_t *m, uint32_t *n) {
    char after, list[64];
    *n = 1;
    if (options->grid) {
        if (sscanf(options->grid, "%5" SCNu32 "x%5" SCNu32 "%c", m, n, &after) != 2)
            refuse("expected a grid such as 10x10, got %s", options->grid);
        snprintf(list, sizeof list, "[%" PRIu32 ",%" PRIu32 "]", *m, *n);
        change(host, "grid", list);
    } else if (options->channels) {
        *m = (uint32_t)number("channels", options->channels, 3, 65535, 0) / 3;
    } else {
        *m = (uint32_t)told_number(host->setup.information, "grid", 0);
        *n = (uint32_t)told_number(host->setup.information, "grid", 1);
    }
    if (!*m || !*n || (uint64_t)*m * *n > 65535 / 3)
        refuse("expected from 1 to 21845 elements, got %" PRIu32 " x %" PRIu32, *m, *n);
    host->setup.channels = (uint16_t)(3 * *m * *n);
}

/* Frames/s asked for, and electronics that are as fast. */
static double take_rate(struct host *host, const struct options *options) {
    const char *text = host->setup.information;
    const double own = told_number(text, "settling_time", 0) + told_number(text, "conversion_time", 0);
    const double most = 1 / (own * host->setup.channels);
    const double rate = number("frames/s", options->rate, 0.001, 1e6, most);
    const double channel_time = 1e9 / (rate * host->setup.channels);
    host->setup.channel_time = channel_time > 4e9 ? 4000000000u : (uint32_t)(channel_time + 1e-6);
    if (!host->setup.channel_time)
        refuse("expected at most 1e9 channels/s, got %g frames/s", rate);
    if (rate > most) {
        char value[32];
        snprintf(value, sizeof value, "%" PRIu32 "e-9", host->setup.channel_time);
        change(host, "conversion_time", value);
        change(host, "settling_time", "0");
    }
    return rate;
}

static void *memory(uint32_t size) {
    void *place = malloc(size);
    if (!place)
        refuse("no memory for %" PRIu32 " bytes", size);
    return place;
}

static void take_memory(struct kappaskin_setup *setup) {
    setup->count_bytes = told_number(setup->information, "bits", 0) > 16 ? 4 : 2;
    setup->frame_room = KAPPASKIN_FRAME(setup->channels, setup->count_bytes);
    setup->frame = memory(setup->frame_room);
    setup->outbox_room = OUTBOX;
    setup->outbox = memory(setup->outbox_room);
}

static void take_board(struct host *host) {
    const struct kappaskin_board board = {
        host,         board_microseconds, board_convert,  board_read, board_write,
        board_temperature, board_light,   board_set_gain,
    };
    host->setup.board = board;
    host->begun = now();
    host->gain = host->first_gain =
        (uint32_t)(1000 * told_number(host->setup.information, "gain", 0) + 0.5);
    if (!host->gain)
        refuse("expected information with a gain of 0.001 and more");
}

static void set_up(struct host *host, const struct options *options) {
    struct kappaskin_device *device = &host->device;
    uint32_t m, n;
    take_information(host, options);
    take_grid(host, options, &m, &n);
    const double rate = take_rate(host, options);
    take_memory(&host->setup);
    take_board(host);
    const char *why = kappaskin_begin(device, &host->setup);
    if (why)
        refuse("%s", why);
    if (1000 * rate < device->rate) /* a channel takes whole ns */
        device->rate = (uint32_t)(1000 * rate + 0.5);
    if (options->counts) {
        play(host, options->counts);
    } else {
        host->counts = pattern(m, n);
        host->frames = STEPS;
        host->round = (uint32_t)((uint64_t)ROUND * device->rate / 1000) + 1;
    }
    host->ppm = (int64_t)number("parts per million", options->clock_ppm, -1e5, 1e5, 0);
    device->sequence = (uint32_t)number("a sequence", options->sequence, 0, UINT32_MAX, 0);
    device->clock = (uint64_t)number("a clock in us", options->clock_offset, 0, 9e15, 0);
    host->link = options->pty_link;
    host->away = (uint64_t)number("ms", options->away, 1, 1e9, 500);
    host->unplug_every = (uint64_t)number("ms", options->unplug_every, 1, 1e9, 0);
    host->plug_time = host->unplug_every ? milliseconds() + host->unplug_every : 0;
}

static void end(struct host *host) {
    const struct kappaskin_device *device = &host->device;
    if (host->line >= 0) {
        if (!hung_up(host)) /* what is unread when the last holder closes is thrown away */
            nap(host, false, LINGER * 1000);
        if (host->link)
            unlink(host->link);
        close(host->line);
    }
    fprintf(stderr, "{\"spent\": %" PRIu32 ", \"unsent\": %" PRIu32 ", \"scans\": %" PRIu32
                    ", \"unplugged\": %" PRIu32 "}\n",
            device->spent, device->spent - device->sent, device->scans, host->unplugged);
}

int main(int count, char **words) {
    static struct host host;
    const struct options options = read_options(count, words);
    const uint32_t frames = (uint32_t)number("frames", options.frames, 1, UINT32_MAX, 0);
    set_up(&host, &options);
    hold_signals();
    plug_in(&host);
    printf("{\"port\": \"%s\", \"rate\": %.3f}\n", host.link ? host.link : host.port,
           host.device.rate / 1e3);
    fflush(stdout);
    serve(&host, frames);
    end(&host);
    return 0;
}
