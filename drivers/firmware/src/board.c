#include "board.h"

#include <string.h>

enum { HELLO = 0x01, ARM = 0x02, COMMAND = 0x03, DISARM = 0x04, CLEAR = 0x05 };
enum { INFO = 0x81, REPLY = 0x82, SAMPLE = 0x83, FAULT = 0x84 };
enum { ARM_SIZE = 12, COMMAND_SIZE = 9, TAG_SIZE = 2, HELLO_SIZE = 3 };
enum { ACCEPTED = 0, WRONG_STATE = 1, BAD_PARAMETER = 2 };
enum { POSITION_INVALID = 1, CLAMPED = 2, IGNORED = 4, LAGGING = 8 };

/* Link quality: bad frames among all of the last 250 to 500 ms; over a tenth, and at least five, is too many. */
enum { WINDOW_US = 500000, HALF_US = WINDOW_US / 2, SHARE = 10, LEAST = 5 };

static const char *const TEXTS[] = {
    "no fault",
    "watchdog: no command came in time",
    "link: too many bad frames",
    "position sensor",
    "drive or amplifier",
    "the board missed its own deadlines",
    "emergency stop",
};

static uint32_t get_u16(const uint8_t *p) { return (uint32_t)p[0] | (uint32_t)p[1] << 8; }

static uint32_t get_u32(const uint8_t *p) { return get_u16(p) | get_u16(p + 2) << 16; }

static int32_t get_i32(const uint8_t *p)
{
    const uint32_t raw = get_u32(p);
    int32_t value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

static uint8_t *put(uint8_t *p, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) {
        *p++ = (uint8_t)(value >> (8 * i));
    }
    return p;
}

static uint8_t *put_text(uint8_t *p, const char *text)
{
    const size_t size = strnlen(text, RT_MAX_TEXT);
    memcpy(p, text, size);
    return p + size;
}

static void send(const rt_board *board, const uint8_t *payload, const uint8_t *end)
{
    uint8_t frame[RT_MAX_FRAME + 1];
    const size_t size = rt_frame(payload, (size_t)(end - payload), frame);
    board->hal->send(board->hal->context, frame, size);
}

static void reply(const rt_board *board, uint8_t tag, uint8_t result)
{
    const uint8_t payload[] = {REPLY, tag, result, (uint8_t)board->state, (uint8_t)board->fault};
    send(board, payload, payload + sizeof payload);
}

static void put_out(rt_board *board, int32_t microvolts)
{
    if (board->output_uv != microvolts) {
        board->output_uv = microvolts;
        board->hal->write_output(board->hal->context, board->now_us, microvolts);
    }
}

static void zero(rt_board *board)
{
    put_out(board, 0);
    board->counters.zeroed++;
}

static void fail(rt_board *board, rt_fault fault)
{
    zero(board);
    board->state = RT_FAULT;
    board->fault = fault;
    uint8_t payload[2 + 8 + RT_MAX_TEXT], *p = payload;
    *p++ = FAULT;
    *p++ = (uint8_t)fault;
    p = put(p, board->now_us, 8);
    p = put_text(p, TEXTS[fault]);
    send(board, payload, p);
}

static void hello(rt_board *board, uint8_t tag)
{
    if (board->state != RT_ARMED) { /* a new session; one that is running is not disturbed */
        board->sequence = 0;
    }
    const rt_facts *facts = board->facts;
    uint8_t payload[RT_MAX_PAYLOAD], *p = payload;
    *p++ = INFO;
    *p++ = RT_VERSION;
    *p++ = tag;
    *p++ = (uint8_t)facts->axis;
    *p++ = (uint8_t)board->state;
    *p++ = (uint8_t)board->fault;
    p = put(p, facts->max_rate_hz, 4);
    p = put(p, facts->voltage_limit_uv, 4);
    uint64_t size;
    memcpy(&size, &facts->count_size, sizeof size);
    p = put(p, size, 8);
    p = put_text(p, facts->text);
    send(board, payload, p);
}

static int same(const rt_arm *a, const rt_arm *b)
{
    return a->tag == b->tag && a->watchdog_ms == b->watchdog_ms && a->voltage_limit_uv == b->voltage_limit_uv
           && a->period_us == b->period_us;
}

static void arm(rt_board *board, const uint8_t *payload)
{
    const rt_arm asked = {
        payload[1], (uint16_t)get_u16(payload + 2), get_u32(payload + 4), get_u32(payload + 8),
    };
    if (board->state == RT_ARMED && same(&asked, &board->arm)) { /* again: its reply was lost */
        reply(board, asked.tag, ACCEPTED);
        return;
    }
    if (board->state != RT_DISARMED) {
        reply(board, asked.tag, WRONG_STATE);
        return;
    }
    const int good = asked.watchdog_ms > 0 && asked.watchdog_ms <= RT_MAX_WATCHDOG_MS && asked.voltage_limit_uv > 0
                     && asked.period_us > 0 && (uint64_t)board->facts->max_rate_hz * asked.period_us >= 1000000u;
    if (!good) {
        reply(board, asked.tag, BAD_PARAMETER);
        return;
    }
    board->arm = asked;
    board->fed_us = board->now_us;
    board->state = RT_ARMED;
    reply(board, asked.tag, ACCEPTED);
}

/* Limit a command to the lower of ARM's limit and the board's own, both clamped to what 32 bits hold. */
static int32_t limited(const rt_board *board, int32_t microvolts)
{
    const uint32_t own = board->facts->voltage_limit_uv, asked = board->arm.voltage_limit_uv;
    uint32_t limit = own < asked ? own : asked;
    if (limit > INT32_MAX) {
        limit = INT32_MAX;
    }
    const int32_t most = (int32_t)limit;
    return microvolts > most ? most : microvolts < -most ? -most : microvolts;
}

static void act(rt_board *board)
{
    const uint32_t sequence = board->pending.sequence;
    const int32_t asked = board->pending.voltage_uv, before = board->output_uv;
    board->pending.waiting = 0;
    board->counters.commands++;
    int64_t position = 0;
    uint8_t flags = 0;
    int failed = 0;
    if (!board->hal->read_position(board->hal->context, board->now_us, &position)) {
        position = 0;
        flags |= POSITION_INVALID;
    }
    if (board->state != RT_ARMED) {
        flags |= IGNORED;
        board->counters.ignored++;
    } else if (flags & POSITION_INVALID) {
        failed = 1;
    } else {
        const int32_t allowed = limited(board, asked);
        if (allowed != asked) {
            flags |= CLAMPED;
            board->counters.clamped++;
        }
        put_out(board, allowed);
        board->fed_us = board->now_us;
    }
    if (board->lagging) {
        flags |= LAGGING;
    }
    if (failed) { /* the output goes first; the sample says so after it */
        zero(board);
        board->state = RT_FAULT;
        board->fault = RT_SENSOR;
    }
    uint8_t payload[64], *p = payload;
    *p++ = SAMPLE;
    p = put(p, sequence, 4);
    p = put(p, board->now_us, 8);
    p = put(p, (uint64_t)position, 8);
    p = put(p, (uint32_t)before, 4);
    *p++ = flags;
    *p++ = (uint8_t)board->state;
    send(board, payload, p);
    if (failed) {
        p = payload;
        *p++ = FAULT;
        *p++ = RT_SENSOR;
        p = put(p, board->now_us, 8);
        p = put_text(p, TEXTS[RT_SENSOR]);
        send(board, payload, p);
    }
}

static void act_on_pending(rt_board *board)
{
    if (board->pending.waiting) {
        act(board);
    }
}

static void command(rt_board *board, const uint8_t *payload)
{
    const uint32_t sequence = get_u32(payload + 1), ahead = sequence - board->sequence;
    if (ahead == 0 || ahead >= 0x80000000u) { /* a duplicate, or older than one already seen */
        board->counters.discarded++;
        return;
    }
    board->counters.superseded += board->pending.waiting;
    board->sequence = sequence;
    board->pending.waiting = 1;
    board->pending.sequence = sequence;
    board->pending.voltage_uv = get_i32(payload + 5);
}

static void disarm(rt_board *board, uint8_t tag)
{
    if (board->state == RT_ARMED) {
        zero(board);
        board->state = RT_DISARMED;
    }
    reply(board, tag, ACCEPTED);
}

static void clear(rt_board *board, uint8_t tag)
{
    if (board->state == RT_ARMED) {
        reply(board, tag, WRONG_STATE);
        return;
    }
    board->state = RT_DISARMED;
    board->fault = RT_NO_FAULT;
    reply(board, tag, ACCEPTED);
}

/* Whether a payload is a message that this version knows, from either side. */
static int known(const uint8_t *payload, int size)
{
    switch (payload[0]) {
    case HELLO:
        return size >= HELLO_SIZE; /* a later version may be longer; what begins it never changes */
    case ARM:
        return size == ARM_SIZE;
    case COMMAND:
        return size == COMMAND_SIZE;
    case DISARM:
    case CLEAR:
        return size == TAG_SIZE;
    default:
        return 0;
    }
}

static void handle(rt_board *board, const uint8_t *payload, int size)
{
    if (!known(payload, size)) {
        board->counters.unknown++;
        return;
    }
    board->counters.good++;
    if (payload[0] == COMMAND) {
        command(board, payload);
        return;
    }
    act_on_pending(board);
    switch (payload[0]) {
    case HELLO:
        hello(board, payload[2]);
        break;
    case ARM:
        arm(board, payload);
        break;
    case DISARM:
        disarm(board, payload[1]);
        break;
    default:
        clear(board, payload[1]);
    }
}

static int too_bad(rt_board *board, uint32_t good, uint32_t bad)
{
    const uint64_t gone = board->now_us - board->quality.begin_us;
    if (gone >= HALF_US) {
        const int recent = gone < WINDOW_US;
        board->quality.older_good = recent ? board->quality.good : 0;
        board->quality.older_bad = recent ? board->quality.bad : 0;
        board->quality.good = board->quality.bad = 0;
        board->quality.begin_us = board->now_us;
    }
    board->quality.good += good;
    board->quality.bad += bad;
    const uint32_t all_bad = board->quality.bad + board->quality.older_bad;
    const uint32_t all = all_bad + board->quality.good + board->quality.older_good;
    return all_bad >= LEAST && SHARE * (uint64_t)all_bad > all;
}

void rt_board_init(rt_board *board, const rt_facts *facts, const rt_hal *hal)
{
    memset(board, 0, sizeof *board);
    board->facts = facts;
    board->hal = hal;
    hal->write_output(hal->context, 0, 0);
}

void rt_board_run(rt_board *board, uint64_t now_us)
{
    if (board->state == RT_ARMED) {
        const uint64_t due = board->fed_us + 1000u * (uint64_t)board->arm.watchdog_ms;
        if (now_us >= due) {
            board->now_us = now_us;
            board->counters.watchdog_trips++;
            fail(board, RT_WATCHDOG);
        }
    }
    if (now_us > board->now_us) {
        board->now_us = now_us;
    }
}

void rt_board_receive(rt_board *board, const uint8_t *bytes, size_t size, uint64_t now_us)
{
    rt_board_run(board, now_us);
    const uint32_t good = board->counters.good, bad = board->counters.bad;
    for (size_t i = 0; i < size; i++) {
        const int length = rt_receive(&board->receiver, bytes[i]);
        if (length == RT_BAD) {
            board->counters.bad++;
        } else if (length > 0) {
            handle(board, board->receiver.bytes, length);
        }
    }
    act_on_pending(board);
    const uint32_t more_good = board->counters.good - good, more_bad = board->counters.bad - bad;
    if ((more_good || more_bad) && too_bad(board, more_good, more_bad) && board->state == RT_ARMED) {
        board->counters.link_faults++;
        fail(board, RT_LINK);
    }
}

void rt_board_fail(rt_board *board, rt_fault fault, uint64_t now_us)
{
    rt_board_run(board, now_us);
    if (board->state == RT_ARMED) {
        fail(board, fault);
    }
}

void rt_board_shut_down(rt_board *board, uint64_t now_us)
{
    rt_board_run(board, now_us);
    if (board->state == RT_ARMED) {
        zero(board);
        board->state = RT_DISARMED;
    }
}
