"""Every way out of the loop ends at zero volts with the device closed and every row there."""

from __future__ import annotations

import json
import math
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from loop_rig import AT, MASS, TICKS, VISCOUS, device, ended_safely, go, plan, replaced, stage, tick

from rtcomp.errors import DeviceError, LimitError
from rtcomp.interrupts import Stop
from rtcomp.loop import run as run_module
from rtcomp.loop.device import Device, EndOfRun
from rtcomp.loop.ring import CLOSED


def test_the_rig_is_a_device():
    assert isinstance(device(stage()), Device)


def test_to_the_end():
    left = go(device(stage()), tick(), plan(TICKS))
    ended_safely(left)
    assert left.outcome.stopped_by == "end"
    assert left.outcome.ticks == len(left.rows) == TICKS
    assert left.outcome.late == left.outcome.lost == 0
    assert left.ring.header[CLOSED] == 1
    # Every command of a row was what the next exchange handed over, the first exchange nothing.
    assert np.array_equal(left.device.commands[1:TICKS], left.column("voltage")[:-1])
    assert left.device.commands[0] == 0.0


FAULTS = {
    "device error": (DeviceError("cable pulled"), DeviceError, "cable pulled", 0),
    "nan": (replaced(position=math.nan), DeviceError, "position nan at tick 250", 1),
    "infinity": (replaced(position=-math.inf), DeviceError, "position -inf at tick 250", 1),
    "travel": (replaced(position=2e-3), LimitError, r"left the travel \[-0.001, 0.001\]", 1),
    "speed": (replaced(position=8e-4), LimitError, r"limits.speed = 0.5 m/s at tick 250", 1),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_stops_at_zero_volts(name):
    what, error, says, extra = FAULTS[name]
    noting = device(stage(), wrong={AT: what})
    left = go(noting, tick(travel=(-1e-3, 1e-3), speed=0.5), plan(TICKS), error=error)
    ended_safely(left)
    assert re.search(says, str(left.outcome)) and "\n" not in str(left.outcome)
    assert len(left.rows) == AT + extra  # the row of the fault itself is there, with zero volts
    if extra:
        assert left.column("voltage")[-1] == 0.0
    assert left.ring.header[CLOSED] == 2
    assert noting.exchanges == AT + 2


def test_a_device_that_has_gone_for_good_is_still_told_and_closed():
    noting = device(stage(), wrong={AT: DeviceError("cable pulled")})
    inner = noting.exchange

    def pulled(volts):
        if noting.exchanges == AT:
            noting.gone = True
        return inner(volts)

    noting.exchange = pulled
    left = go(noting, tick(), plan(TICKS), error=DeviceError)
    assert noting.calls[-2:] == [("exchange", 0.0), ("close", 0.0)]
    assert left.ring.header[CLOSED] == 2 and len(left.rows) == AT


def test_zero_volts_that_do_not_arrive_after_a_good_run_are_an_error():
    noting = device(stage(), wrong={TICKS: DeviceError("no answer to zero volts")})
    left = go(noting, tick(), plan(TICKS), error=DeviceError)
    assert "zero volts" in str(left.outcome)
    assert noting.calls[-1] == ("close", 0.0) and len(left.rows) == TICKS


def test_an_error_of_another_kind_is_no_way_round_the_zero():
    noting = device(stage(), wrong={AT: RuntimeError("a bug in a driver")})
    left = go(noting, tick(), plan(TICKS), error=RuntimeError)
    ended_safely(left)
    assert len(left.rows) == AT


def test_a_device_that_cannot_be_had_is_let_go():
    noting = device(stage())

    def refuse():
        noting.calls.append(("open", 0.0))
        raise DeviceError("busy")

    noting.open = refuse
    left = go(noting, tick(), plan(TICKS), error=DeviceError)
    assert str(left.outcome) == "busy"
    assert noting.calls[-1] == ("close", 0.0) and len(left.rows) == 0


def test_a_recording_that_ends_ends_the_run_well():
    left = go(device(stage(), wrong={AT: EndOfRun()}), tick(), plan(TICKS))
    assert left.outcome.stopped_by == "device" and left.outcome.ticks == len(left.rows) == AT
    assert left.device.calls[-2:] == [("exchange", 0.0), ("close", 0.0)]
    assert left.ring.header[CLOSED] == 1


def test_a_plan_that_fails_stops_at_zero_volts(monkeypatch):
    class Broken:
        ticks = 200_000

        def rows(self, first, count):
            if first:
                raise LimitError("the reference file ended")
            return plan(count).rows(0, count)

    monkeypatch.setattr(run_module, "BLOCK", 300)
    left = go(device(stage()), tick(), Broken(), error=LimitError)
    ended_safely(left)
    assert len(left.rows) == 300


def test_asked_to_stop_it_stops_at_the_next_tick():
    stop = Stop()

    def ask(sample):
        stop.requested = True
        return sample

    left = go(device(stage(), wrong={AT: ask}), tick(), plan(TICKS), stop=stop)
    ended_safely(left)
    assert left.outcome.stopped_by == "signal" and left.outcome.ticks == len(left.rows) == AT + 1
    assert left.ring.header[CLOSED] == 1


@pytest.mark.parametrize(
    ("number", "how"), [(signal.SIGINT, "once"), (signal.SIGTERM, "once"), (signal.SIGTERM, "again")]
)
def test_a_signal_to_the_process_ends_it_in_order(number, how):
    script = Path(__file__).parent / "signalled_process.py"
    child = subprocess.Popen([sys.executable, script, how], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == "running\n"
        time.sleep(0.6)
        child.send_signal(number)
        said, _ = child.communicate(timeout=30)
    finally:
        child.kill()
        child.wait()
    assert child.returncode == 0
    left = json.loads(said)
    assert left["stopped_by"] == "signal" and 0 < left["ticks"] < 60_000 and left["rows"] == left["ticks"]
    assert left["last_volts"] == 0.0 and left["last_call"] == "close" and left["closed"] == 1
    assert left["largest"] > 0.1 and left["handler"] == "True"


def test_the_numbers_of_the_rig_are_those_of_its_stage():
    assert stage().mass == MASS and stage().mechanics.viscous == VISCOUS
