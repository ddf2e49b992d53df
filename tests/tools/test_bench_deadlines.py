"""The tables of the deadlines' benchmarks say the right thing of known inputs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bench_endurance
import bench_fuzz
import bench_lateness
import bench_roundtrip
import bench_watchdog
import h5py
import numpy as np
import pytest
from bench_kill import ring_of
from rtcomp_drivers import protocol

from rtcomp.bench.link import RoundTrips
from rtcomp.bench.loop import AtRate, Measured
from rtcomp.bench.spread import Spread


def at_rate(loop: list[float], cyclic: list[float] | None) -> AtRate:
    runners = {"loop": Measured(Spread.of(loop), 1000.0)}
    if cyclic is not None:
        runners["cyclictest"] = Measured(Spread.of(cyclic), 1000.0)
    runners["plain Python"] = Measured(Spread.of([5000.0] * 10), 1000.0)
    return AtRate(1000.0, runners, Spread.of([1.0]), {})


def lateness(loop: list[float], cyclic: list[float] | None) -> dict[str, tuple[float, bool | None]]:
    return {f.name: (f.value, f.met) for f in bench_lateness.figures_of(at_rate(loop, cyclic), "")}


def test_lateness_is_met_or_missed_by_its_ratio_to_cyclictest() -> None:
    found = lateness([10.0] * 99 + [50.0], [20.0] * 99 + [40.0])
    assert found["1 kHz: p50 over cyclictest's"] == (0.5, None)
    assert found["1 kHz: p99 over cyclictest's"] == (0.5, True)
    assert found["1 kHz: p99.9 over cyclictest's"] == (1.25, False)
    assert found["1 kHz: slots missed"] == (0.0, True)


def test_slots_missed_are_a_share_of_all_slots() -> None:
    found = lateness([0.0] * 95 + [2500.0] * 5, [0.0] * 95 + [2500.0] * 2 + [0.0] * 3)
    assert found["1 kHz: slots missed"] == (pytest.approx(100.0 * 10 / 110), False)


def test_nothing_late_at_all_divides_by_the_one_microsecond_that_cyclictest_can_tell() -> None:
    assert lateness([0.5] * 10, [0.0] * 10)["1 kHz: p99 over cyclictest's"] == (0.5, True)


def test_without_cyclictest_nothing_is_judged() -> None:
    found = lateness([10.0] * 100, None)
    assert found["1 kHz: p99"] == (10.0, None) and found["1 kHz: slots missed"] == (0.0, None)


def test_round_trips_are_judged_by_their_ratio_and_odd_ones_counted() -> None:
    trips = RoundTrips(
        1000.0, Spread.of([50.0] * 50 + [90.0] * 50), Spread.of([40.0] * 50 + [60.0] * 50),
        {"sent": 102, "samples": 101, "missed": 2, "duplicate": 1}, {},
    )  # fmt: skip
    found = {f.name: (f.value, f.met) for f in bench_roundtrip.figures_of(trips, "serial, board")}
    assert found["serial, board: p50 over raw"] == (1.25, True)
    assert found["serial, board: p99 over raw"] == (1.5, False)
    assert found["serial, board: exchanges otherwise than well"] == (3.0, None)
    found = {f.name: f.met for f in bench_roundtrip.figures_of(trips, "can", "python-can", 1.2)}
    assert found["can: p50 over python-can"] is False


def test_one_moment_without_a_watchdog_is_told() -> None:
    seen = bench_watchdog.Seen(
        moments=2, since_command=[0.05], after_signal=[0.049], refused=2, disarmed=2, moved=[1e-9, 2e-7],
        output=[0.0, 0.0],
    )  # fmt: skip
    met = {f.name.removeprefix("x: "): f.met for f in bench_watchdog.figures_of(seen, "x")}
    assert met["zeroed by the watchdog"] is False and met["moved by arming again, most"] is False
    assert met["a new host is refused"] and met["output when armed again, most"]
    assert met["zero after the last command, worst"]
    late = bench_watchdog.Seen(
        moments=1, since_command=[0.052], after_signal=[0.05], moved=[0.0], output=[0.1]
    )
    met = {f.name.removeprefix("x: "): f.met for f in bench_watchdog.figures_of(late, "x")}
    assert (
        met["zero after the last command, worst"] is False and met["output when armed again, most"] is False
    )


def test_each_run_gets_the_zeroing_that_is_its_own() -> None:
    seen = bench_watchdog.Seen(moments=3)
    times = [(10.0, 10.5), (12.0, 12.5), (14.0, 14.5)]
    bench_watchdog.tell(seen, times, [(10.54, 0.05), (12.2, 0.051), (9.0, 0.9)])
    assert seen.since_command == [0.05, 0.051]  # the third has none
    assert seen.after_signal == [pytest.approx(0.04), 0.0] and seen.already == 1


def test_memory_that_grows_after_warming_up_is_seen_and_what_comes_and_goes_is_not() -> None:
    warming = [100.0 + 0.1 * k for k in range(20)]
    flat = [200.0 * 1024 + 3000.0 * (k % 7 == 0) for k in range(180)]
    assert bench_endurance.Held({"loop": [*warming, *flat]}).growth_mb("loop") == pytest.approx(0.0)
    rising = [200.0 * 1024 + 20.48 * k for k in range(200)]
    assert bench_endurance.Held({"loop": rising}).growth_mb("loop") == pytest.approx(
        20.48 * 170 / 1024, rel=0.1
    )


def recording(path: Path, time: np.ndarray, complete: int = 1) -> Path:
    with h5py.File(path, "w") as file:
        file["time"], file["position"] = time, np.zeros(time.size)
        file.create_group("weights")["time"] = np.zeros(3)
        file.attrs["complete"] = complete
    return path


def test_a_recording_is_whole_only_with_every_row_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench_endurance, "PIECE", 64)
    time = np.arange(1000) / 500.0
    assert bench_endurance.complete(recording(tmp_path / "a.h5", time), 500.0, 1000) == 1.0
    assert bench_endurance.complete(recording(tmp_path / "b.h5", time[:990]), 500.0, 1000) == 0.99
    assert bench_endurance.complete(recording(tmp_path / "c.h5", time, 0), 500.0, 1000) == 0.0
    time[17] = np.nan
    assert bench_endurance.complete(recording(tmp_path / "d.h5", time), 500.0, 1000) == 0.999
    shifted = np.delete(np.arange(1001) / 500.0, 900)  # a row lost, the count made up at the end
    assert bench_endurance.complete(recording(tmp_path / "e.h5", shifted), 500.0, 1000) == 0.9


def test_a_codec_without_its_check_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fuzz can fail: with any CRC taken for right, bad frames come in."""
    assert bench_fuzz.fuzz(100_000, 3)[2] == 0
    unchecked = lambda piece: (protocol.unstuff(piece) or b"")[:-4] or None  # noqa: E731
    monkeypatch.setattr(protocol, "payload_of", unchecked)
    assert bench_fuzz.fuzz(100_000, 3)[2] > 0


def test_the_ring_of_a_loop_is_not_the_one_that_it_warms_up_on() -> None:
    script = (
        "from rtcomp.loop.ring import Ring\n"
        "scratch = Ring.create(2, 3)\n"
        "scratch.header[3] = 4\n"
        "print('scratch', flush=True)\n"
        "input()\n"
        "real = Ring.create(64, 3)\n"
        "real.header[3] = 4\n"
        "print('real', flush=True)\n"
        "input()\n"
    )
    loop = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert loop.stdin is not None and loop.stdout is not None
    try:
        assert loop.stdout.readline() == "scratch\n"
        assert ring_of(loop.pid) is None
        loop.stdin.write("\n")
        loop.stdin.flush()
        assert loop.stdout.readline() == "real\n"
        found = ring_of(loop.pid)
        assert found is not None and found.capacity == 64
        found.release()
    finally:
        loop.communicate("\n", timeout=60)


def test_one_stall_says_nothing_of_who_misses_more() -> None:
    """Thirty slots in one stretch of many: chance. As many more in every stretch: no chance."""
    one = AtRate(1000.0, {}, Spread.of([1.0]), {}, {"loop": (30, *[0] * 29), "cyclictest": (0,) * 30})
    low, high = one.by_chance("cyclictest")
    assert low == 0.0 and high > 1.0
    every = AtRate(1000.0, {}, Spread.of([1.0]), {}, {"loop": (3,) * 30, "cyclictest": (1, 2) * 15})
    assert every.by_chance("cyclictest")[0] > 1.0
