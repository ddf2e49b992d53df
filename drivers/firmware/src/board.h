/* What a board does: states, watchdog, limits, and the answers of the serial protocol (drivers/README.md).
 *
 *              ARM                     watchdog, link, sensor, drive, e-stop
 * DISARMED ----------------> ARMED ----------------------------------------> FAULT
 *    ^  ^      DISARM          |                                               |
 *    |  +----------------------+                  CLEAR                        |
 *    +-------------------------------------------------------------------------+
 *
 * The output is zero in every state but ARMED. No memory is allocated, nothing waits, no clock is read: time
 * is handed in, in us since any start, never going back. Call everything from one context, or keep interrupts
 * out: `rt_board_run` from a timer at 1 kHz or faster is what makes the watchdog a watchdog.
 */
#ifndef RTCOMP_BOARD_H
#define RTCOMP_BOARD_H

#include "frame.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { RT_VERSION = 1, RT_MAX_TEXT = 64, RT_MAX_WATCHDOG_MS = 10000 };

typedef enum { RT_DISARMED = 0, RT_ARMED = 1, RT_FAULT = 2 } rt_state;

typedef enum {
    RT_NO_FAULT = 0,
    RT_WATCHDOG = 1,
    RT_LINK = 2,
    RT_SENSOR = 3,
    RT_DRIVE = 4,
    RT_OVERRUN = 5,
    RT_ESTOP = 6
} rt_fault;

typedef enum { RT_LINEAR = 0, RT_ROTARY = 1 } rt_axis;

/* What a board has to give. */
typedef struct {
    void *context; /* handed to each */
    /* Read the position (counts); return 0 where it must not be used. */
    int (*read_position)(void *context, uint64_t now_us, int64_t *counts);
    /* Put out so many microvolts from now on. Called only where it changes, and must not wait. */
    void (*write_output)(void *context, uint64_t now_us, int32_t microvolts);
    /* Send to the host; what there is no room for may be dropped. */
    void (*send)(void *context, const uint8_t *bytes, size_t size);
} rt_hal;

/* What the board says of itself. */
typedef struct {
    rt_axis axis;
    uint32_t voltage_limit_uv; /* the board's own; ARM can only lower it */
    uint32_t max_rate_hz;
    double count_size; /* m or rad per count */
    const char *text;  /* at most RT_MAX_TEXT bytes */
} rt_facts;

typedef struct {
    uint32_t commands, discarded, superseded, ignored, clamped, watchdog_trips, link_faults, zeroed;
    uint32_t good, bad, unknown; /* frames */
} rt_counters;

typedef struct {
    uint8_t tag;
    uint16_t watchdog_ms;
    uint32_t voltage_limit_uv, period_us;
} rt_arm;

typedef struct {
    const rt_facts *facts;
    const rt_hal *hal;
    rt_receiver receiver;
    rt_counters counters;
    rt_state state;
    rt_fault fault;
    int32_t output_uv;
    uint8_t lagging; /* set by whoever runs the board where it cannot keep up; travels in every sample */
    uint64_t now_us, fed_us;
    uint32_t sequence;
    rt_arm arm;
    struct {
        uint64_t begin_us;
        uint32_t good, bad, older_good, older_bad;
    } quality;
    struct {
        uint8_t waiting;
        uint32_t sequence;
        int32_t voltage_uv;
    } pending;
} rt_board;

/* Start DISARMED, output zero. `facts` and `hal` must outlive the board. */
void rt_board_init(rt_board *board, const rt_facts *facts, const rt_hal *hal);

/* Let time pass; the watchdog acts here. */
void rt_board_run(rt_board *board, uint64_t now_us);

/* Take bytes that arrived; of several commands among them only the newest is acted on and answered. */
void rt_board_receive(rt_board *board, const uint8_t *bytes, size_t size, uint64_t now_us);

/* Something that the board itself noticed: drive, e-stop, an overrun of its own. Zero, and FAULT, where ARMED. */
void rt_board_fail(rt_board *board, rt_fault fault, uint64_t now_us);

/* Zero the output because the board ends. */
void rt_board_shut_down(rt_board *board, uint64_t now_us);

#ifdef __cplusplus
}
#endif
#endif
