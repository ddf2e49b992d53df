"""What stands where: the columns of a plan and of the ring, the tick's settings and its state.

Numbers only, so that every compiled part of the tick (`tick`, `checks`, `pace`) reads the same.
"""

from __future__ import annotations

REFERENCE, LEAD_POSITION, LEAD_FORCE, KNOWN, FEEDFORWARD, LEARN, VOLTS, LET_GO = range(8)
"""Columns of a plan. Reference at the tick (m); reference where the command will act (m); force needed
there but for hysteresis (N); forces known to have acted around the tick before, other than inertia and
viscous friction (N); share of feedforward (0 to 1); whether to learn (0 or 1); command in open loop (V);
share of the whole command that is taken off (0 to 1)."""
PLAN_WIDTH = 8

COLUMNS = (
    "time", "reference", "position", "voltage", "force", "force_model", "feedforward", "feedback",
    "device_time", "sequence", "status", "lateness_us", "execution_us", "overrun", "learning", "state",
)  # fmt: skip
"""What the tick writes into the ring, then the weights and the offset."""
(
    ROW_TIME, ROW_REFERENCE, ROW_POSITION, ROW_VOLTAGE, ROW_FORCE, ROW_FORCE_MODEL, ROW_FEEDFORWARD,
    ROW_FEEDBACK, ROW_DEVICE_TIME, ROW_SEQUENCE, ROW_STATUS, ROW_LATENESS, ROW_EXECUTION, ROW_OVERRUN,
    ROW_LEARNING, ROW_STATE,
) = range(len(COLUMNS))  # fmt: skip

(
    OK, NOT_FINITE, TRAVEL, SPEED, JUMP, STUCK, SIGN, SILENT, FROZEN, NO_POSITION, COMMAND, OVERRUN, ESTOP,
) = range(13)  # fmt: skip
"""What the checks of a tick may find: nothing; a position that is no number; one outside the travel; one
that moved faster than the axis may; one that no force explains; an axis that does not move although driven;
one that moves against its drive; no sample for too long; samples that are not new; a position that must not
be used; a command that is no number; too many slots lost; an emergency stop."""

(
    PERIOD, FORCE_CONSTANT, MASS, VISCOUS, GATE, TRAVEL_LOW, TRAVEL_HIGH, SPEED_LIMIT, DELAY, OFFSET_SCALE,
    CLOSED, JUMP_LIMIT, COUNT, STUCK_VOLTS, STUCK_TICKS, SIGN_VOLTS, SIGN_TICKS, AGE_TICKS, INVALID_TICKS,
    LATE_US, SLOTS_LOST, DEVICE_PACED, FORCE_BOUND,
) = range(23)  # fmt: skip
"""Settings: s, N/V, kg, N s/m, m, m, m, m/s, ticks, m (regressor of the offset), 1 for closed loop; then
of the checks: m, m (one count), V, ticks, V, ticks (half of the window), ticks, ticks; of the pace: us from
which a tick is late, slots lost until a fault, 1 where the device sets the pace; N beyond which a model is
not believed."""
(
    GOOD, X1, X2, LAST_REFERENCE, LEARNED_AT, EXCESS, FAULT, COMPUTED, UPDATES, STARTED,
    MODE, SHARE, LAST_SHARE, HANDED, OWN, CARRIED, CHANGED,
    LATE_RUN, LATE_BITS, LATE_SUM, CLEAN, LOST, HELD, DIVERGED, DEGRADED_TIMES,
    AGE, INVALID_RUN, REPEATED_RUN, REPEATED, LAST_SEQUENCE, LAST_TIME,
    MEASURED_AT, MEASURED_SPEED, SINCE, RESTED, RESTED_AT, STUCK_RUN, STUCK_AT, PUSHED, PUSHED_AT,
    PUSHED_MID, TRIED, OWN_OFF, KEPT_OFF, TAKEN_BACK, BEYOND, HISTORY,
) = range(47)  # fmt: skip
"""State: good samples in a row until now; positions one and two ticks ago (m); reference one tick ago (m);
position at the last update (m); what the limits cut from the last command (V); what the check found;
execution time of the last tick (us); updates of the weights; whether there was a sample.

Of the states and the pace: `states.State`; share of the feedforward that the state lets through, now and one
tick ago; the feedforward of the last tick (V); the integral's own part when feedforward went off (V), and
what it carries in feedforward's place and has not given back (V); whether the model has become another since;
late ticks in a row; the last 32 ticks, a bit each, and how many were late; ticks in time in a row; slots lost
and not forgiven; ticks until a diverged identifier may go on; how often it diverged; how often degraded.

Of the checks: ticks since a sample was new; without a valid position; with a sample that was not new, in a
row and in all; the last sequence and device time; the last measured position (m), the speed there (m a tick),
and the ticks since; ticks at rest, and where (m); ticks stuck, and where (m); ticks driven one way (signed),
and where that began and was half over (m).

Of the guard: updates since the weights kept; mean squares of what the weights and those kept did not foresee
(N^2); how often the weights were taken back to those. Ticks in a row in which a resting axis was elsewhere.
From here on the commands of the last ticks, newest first (V)."""

LATE_IN_ROW, LATE_OF, WINDOW, CLEAN_TICKS = 3, 8, 32, 32
"""Late ticks in a row, and among the last `WINDOW`, that degrade; ticks in time after which it is over."""
FORGIVE = 1.0 / 100.0
"""Slots lost that each tick in time takes back: one slot in a hundred may be lost for ever."""
FADE, FADE_ANEW = 1.0 / 16.0, 1.0 / 128.0
"""Share of the feedforward that comes back with each tick: of the model that went off; of one that was put
aside and learns anew, whose first updates are large."""
REPEATED_TICKS = 5
"""Samples in a row that say they are new and are not, after which the device is not believed."""
REST_TICKS = 100.0
"""Ticks within a count of one place after which the axis rests: there is nothing to learn from."""
MOVES_TICKS = 10.0
"""Ticks in a row that a resting axis must be elsewhere before it moves: noise is, now and then, for one."""
HELD_TICKS = 1000.0
"""Ticks that a diverged identifier is put aside."""
SETTLING, COMPARED, KEPT_EVERY = 500.0, 2000.0, 4000.0
"""Updates of a learner that begins which do not count; from which on it is compared with the weights kept;
after which it gives its own to be kept, if they foresaw no worse."""
COMPARE_MEMORY, WORSE = 1000.0, 2.0
"""Updates over which both are averaged; ratio of the mean squares from which on learning has spoiled them."""
MOST_DIVERGED = 3.0
"""Times after which it stays aside to the end of the run."""
