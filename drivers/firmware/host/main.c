/* The firmware as a process: the same frame.c and board.c that a board runs, on a computer.
 *
 * rtcomp-board --virtual          time, position and bytes from stdin, output and bytes to stdout: for tests
 * rtcomp-board --port N --plant M in real time between a port (descriptor N, a pseudo-terminal's master) and
 *                                 what hangs on output and sensor (descriptor M, a socket): see below
 *
 * Options: --axis linear|rotary, --limit-uv N, --rate HZ, --count-size X, --text TEXT, --began-us N (start of
 * the board's clock on the monotonic one).
 * At the end it writes its counters as one line of JSON to stderr.
 */
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "../src/board.h"

enum { ROOM = 1 << 16, MOST = 4096, SLICE_US = 250 };

static volatile sig_atomic_t stopped;

static void stop(int number)
{
    (void)number;
    stopped = 1;
}

/* Read or write all of it; 0 at the end of the file or on an error. */
static int whole(int descriptor, void *data, size_t size, int writing)
{
    uint8_t *p = data;
    while (size > 0) {
        const ssize_t n = writing ? write(descriptor, p, size) : read(descriptor, p, size);
        if (n < 0 && errno == EINTR && !stopped) {
            continue;
        }
        if (n <= 0) {
            return 0;
        }
        p += n;
        size -= (size_t)n;
    }
    return 1;
}

/* -- virtual time ---------------------------------------------------------------------------------------- */

struct virtual {
    int64_t position;
    int valid;
    uint8_t sent[ROOM];
    size_t size;
};

static int virtual_position(void *context, uint64_t now_us, int64_t *counts)
{
    const struct virtual *v = context;
    (void)now_us;
    *counts = v->position;
    return v->valid;
}

static void virtual_output(void *context, uint64_t now_us, int32_t microvolts)
{
    (void)context, (void)now_us, (void)microvolts;
}

static void virtual_send(void *context, const uint8_t *bytes, size_t size)
{
    struct virtual *v = context;
    if (size <= sizeof v->sent - v->size) {
        memcpy(v->sent + v->size, bytes, size);
        v->size += size;
    }
}

#pragma pack(push, 1)
struct step { /* then `size` bytes */
    uint64_t now_us;
    int64_t position;
    uint8_t valid;
    uint32_t size;
};
struct outcome { /* then `size` bytes */
    int32_t output_uv;
    uint8_t state, fault;
    uint32_t size;
};
struct asked { /* to the plant: 'M', measure, answered by a struct measured; 'O', this output from now on */
    uint8_t what;
    uint64_t now_us;
    int32_t output_uv;
};
struct measured {
    uint8_t valid;
    int64_t position;
};
#pragma pack(pop)

static int run_virtual(rt_board *board, const rt_facts *facts)
{
    static struct virtual v;
    static uint8_t bytes[ROOM];
    static const rt_hal hal = {&v, virtual_position, virtual_output, virtual_send};
    rt_board_init(board, facts, &hal);
    struct step step;
    while (whole(0, &step, sizeof step, 0)) {
        if (step.size > sizeof bytes || !whole(0, bytes, step.size, 0)) {
            return 1;
        }
        v.position = step.position;
        v.valid = step.valid;
        v.size = 0;
        if (step.size > 0) {
            rt_board_receive(board, bytes, step.size, step.now_us);
        } else {
            rt_board_run(board, step.now_us);
        }
        struct outcome outcome = {board->output_uv, (uint8_t)board->state, (uint8_t)board->fault, (uint32_t)v.size};
        if (!whole(1, &outcome, sizeof outcome, 1) || !whole(1, v.sent, v.size, 1)) {
            return 1;
        }
    }
    return 0;
}

/* -- real time ------------------------------------------------------------------------------------------- */

struct real {
    int port, plant;
    uint64_t unsent;
};

static int real_position(void *context, uint64_t now_us, int64_t *counts)
{
    const struct real *r = context;
    struct asked asked = {'M', now_us, 0};
    struct measured measured;
    if (!whole(r->plant, &asked, sizeof asked, 1) || !whole(r->plant, &measured, sizeof measured, 0)) {
        stopped = 1;
        return 0;
    }
    *counts = measured.position;
    return measured.valid;
}

static void real_output(void *context, uint64_t now_us, int32_t microvolts)
{
    const struct real *r = context;
    struct asked asked = {'O', now_us, microvolts};
    if (!whole(r->plant, &asked, sizeof asked, 1)) {
        stopped = 1;
    }
}

static void real_send(void *context, const uint8_t *bytes, size_t size)
{
    struct real *r = context;
    const ssize_t n = write(r->port, bytes, size); /* does not wait: what no host reads is lost */
    r->unsent += n < 0 ? size : size - (size_t)n;
}

static uint64_t began_us; /* on the monotonic clock */

static uint64_t now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u - began_us;
}

static int run_real(rt_board *board, const rt_facts *facts, int port, int plant)
{
    static uint8_t bytes[MOST];
    static struct real real;
    static const rt_hal hal = {&real, real_position, real_output, real_send};
    real.port = port;
    real.plant = plant;
    rt_board_init(board, facts, &hal);
    struct pollfd watched[] = {{port, POLLIN, 0}, {plant, 0, 0}};
    const struct timespec slice = {0, 1000 * SLICE_US};
    while (!stopped) {
        if (ppoll(watched, 2, &slice, NULL) < 0 && errno != EINTR) {
            break;
        }
        if (watched[1].revents & (POLLHUP | POLLERR | POLLNVAL)) {
            break;
        }
        ssize_t n = 0;
        if (watched[0].revents & POLLIN) {
            n = read(port, bytes, sizeof bytes);
        }
        if (n > 0) {
            rt_board_receive(board, bytes, (size_t)n, now_us());
        } else {
            rt_board_run(board, now_us());
        }
    }
    rt_board_shut_down(board, now_us());
    return 0;
}

/* -- both ------------------------------------------------------------------------------------------------ */

static int refuse(const char *what, const char *value)
{
    fprintf(stderr, "rtcomp-board: %s%s\n", what, value);
    return 2;
}

static void say_counters(const rt_board *board)
{
    const rt_counters *c = &board->counters;
    fprintf(stderr,
            "{\"good\": %u, \"bad\": %u, \"unknown\": %u, \"commands\": %u, \"discarded\": %u, \"superseded\": %u, "
            "\"ignored\": %u, \"clamped\": %u, \"watchdog_trips\": %u, \"link_faults\": %u, \"zeroed\": %u, "
            "\"state\": %u, \"output_uv\": %d}\n",
            c->good, c->bad, c->unknown, c->commands, c->discarded, c->superseded, c->ignored, c->clamped,
            c->watchdog_trips, c->link_faults, c->zeroed, (unsigned)board->state, (int)board->output_uv);
}

int main(int count, char **arguments)
{
    static rt_board board;
    rt_facts facts = {RT_LINEAR, 10000000u, 20000u, 1e-12, "rtcomp firmware, host build"};
    int in_virtual_time = 0, port = -1, plant = -1;
    for (int i = 1; i < count; i++) {
        const char *name = arguments[i];
        if (strcmp(name, "--virtual") == 0) {
            in_virtual_time = 1;
            continue;
        }
        if (i + 1 == count) {
            return refuse("no value, or unknown: ", name);
        }
        const char *value = arguments[++i];
        if (strcmp(name, "--port") == 0) {
            port = atoi(value);
        } else if (strcmp(name, "--plant") == 0) {
            plant = atoi(value);
        } else if (strcmp(name, "--axis") == 0) {
            if (strcmp(value, "linear") != 0 && strcmp(value, "rotary") != 0) {
                return refuse("--axis is linear or rotary, not ", value);
            }
            facts.axis = strcmp(value, "rotary") == 0 ? RT_ROTARY : RT_LINEAR;
        } else if (strcmp(name, "--limit-uv") == 0) {
            facts.voltage_limit_uv = (uint32_t)strtoul(value, NULL, 10);
        } else if (strcmp(name, "--rate") == 0) {
            facts.max_rate_hz = (uint32_t)strtoul(value, NULL, 10);
        } else if (strcmp(name, "--count-size") == 0) {
            facts.count_size = strtod(value, NULL);
        } else if (strcmp(name, "--began-us") == 0) {
            began_us = strtoull(value, NULL, 10);
        } else if (strcmp(name, "--text") == 0) {
            facts.text = value;
        } else {
            return refuse("unknown option ", name);
        }
    }
    if (!in_virtual_time && (port < 0 || plant < 0)) {
        return refuse("give --virtual, or --port and --plant", "");
    }
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    const int status = in_virtual_time ? run_virtual(&board, &facts) : run_real(&board, &facts, port, plant);
    say_counters(&board);
    return status;
}
