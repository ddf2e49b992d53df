"""From a closed device to the first command: what is looked at first, and that arming moves nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import GAINS, NotingDevice, TablePlan, device, go, plan, stage, tick
from rtcomp_drivers.driver import Bench
from rtcomp_drivers.simulated import SimulatedDriver, SimulatedSettings

from rtcomp.errors import DeviceError, EmergencyStopError, LimitError
from rtcomp.loop.clock import VirtualClock
from rtcomp.loop.device import INVALID, STALE, Armable, Sample
from rtcomp.loop.layout import PLAN_WIDTH
from rtcomp.loop.ring import Ring
from rtcomp.loop.run import run
from rtcomp.loop.states import Machine, State

TICKS = 60


class Armed(NotingDevice):
    """The noting device, with something to look at before it is armed."""

    seen = Sample(1e-6, 0.0, 0)

    def look(self):
        self.calls.append(("look", 0.0))
        return self.seen

    def arm(self):
        self.calls.append(("arm", 0.0))


def armed(**seen):
    noting = Armed(device(stage()).inner)
    noting.seen = noting.seen._replace(**seen)
    return noting


def test_it_is_looked_at_then_armed_then_driven():
    noting, machine = armed(), Machine()
    left = go(noting, tick(), plan(TICKS), machine=machine)
    names = [name for name, _ in noting.calls]
    assert names[:4] == ["open", "look", "arm", "exchange"] and names[-2:] == ["exchange", "close"]
    assert isinstance(noting, Armable) and machine.state is State.DISCONNECTED
    assert (left.column("state") == State.RUNNING).all()


@pytest.mark.parametrize(
    ("seen", "error", "says"),
    [
        ({"position": math.nan}, DeviceError, "no position that can be used"),
        ({"status": INVALID}, DeviceError, "status 2"),
        ({"status": STALE}, DeviceError, "status 1"),
        ({"position": 2e-3}, LimitError, r"stands at 0.002 m, outside the travel \[-0.001, 0.001\] m"),
    ],
)
def test_what_does_not_look_right_is_not_armed(seen, error, says):
    noting, machine, told = armed(**seen), Machine(), []
    left = go(
        noting, tick(travel=(-1e-3, 1e-3)), plan(TICKS), error=error, machine=machine,
        tell=lambda *event: told.append(event),
    )  # fmt: skip
    with pytest.raises(error, match=says):
        raise left.outcome
    assert "nothing was armed" in str(left.outcome)
    assert [name for name, _ in noting.calls] == ["open", "look", "close"]  # no exchange: that would arm it
    assert machine.state is State.FAULT and told == [(0.0, 7, str(left.outcome))] and len(left.rows) == 0


def test_an_emergency_stop_that_is_pressed_already_arms_nothing():
    noting, the_tick = armed(), tick()
    ring = Ring.create(TICKS, the_tick.row_width)
    ring.stop(2)
    with pytest.raises(EmergencyStopError, match="by the stop file: nothing was armed"):
        run(noting, the_tick, plan(TICKS), VirtualClock(), ring)
    assert [name for name, _ in noting.calls] == ["open", "close"]
    ring.release()


def test_before_the_first_good_sample_nothing_goes_out():
    """Neither at first nor later a command that no measurement stands behind."""
    stale = {k: (lambda s: s._replace(status=STALE, position=0.5)) for k in range(7)}
    noting, machine = device(stage(), wrong=stale), Machine()
    left = go(noting, tick(travel=(-1e-3, 1e-3)), plan(300), machine=machine)
    assert not left.column("voltage")[:7].any() and left.column("voltage")[20:].any()
    assert left.column("state")[:8].tolist() == [State.CONNECTED] * 7 + [State.RUNNING]
    never = dict.fromkeys(range(300), stale[0])
    left = go(device(stage(), wrong=never), tick(age_ticks=20), plan(300), error=DeviceError)
    assert len(left.rows) == 21 and not left.column("voltage").any()


@settings(max_examples=40, deadline=None)
@given(
    st.integers(-500, 500).map(lambda um: 1e-6 * um),
    st.integers(-60, 60).map(lambda v: 0.1 * v),
    st.integers(1, 400),
    st.sampled_from([0, 1]),
)
def test_arming_anywhere_with_friction_preloaded_commands_no_jump(start, push, ticks, delay):
    """Somebody, or something, has pushed the axis and let it go; where it stands is where it begins."""
    bench = Bench(stage=stage(), period=1e-3, start=start)
    inner = SimulatedDriver(SimulatedSettings(driver="simulated", delay_ticks=delay), bench)
    inner.open()
    for _ in range(ticks):
        inner.exchange(push)
    for _ in range(8000):
        last = inner.exchange(0.0)  # let go: friction holds it, wound up
    noting = NotingDevice(inner)
    table = np.zeros((40, PLAN_WIDTH))
    table[:, :2] = last.position
    left = go(noting, tick(delay=delay), TablePlan(table))
    crept = np.abs(left.column("position") - last.position).max()
    assert np.abs(left.column("voltage")).max() <= 1e-6 + 4.0 * GAINS[0] * crept
    assert np.abs(left.column("voltage")).max() < 0.02
    moved = np.abs(np.diff(left.column("position"))).max()
    assert moved < 1e-8
