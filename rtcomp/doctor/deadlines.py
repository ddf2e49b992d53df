"""What deadlines hang on: the scheduler, memory, the clock, the processor.

Paths are looked up below `root`, so that a machine can be described by a folder.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from pathlib import Path

from rtcomp.doctor.files import number, text
from rtcomp.doctor.finding import BAD, GOOD, WEAK, Finding
from rtcomp.loop.realtime import PRIORITY, timer_slack_ns

LIMITS = "/etc/security/limits.d/99-rtcomp.conf"
MEMORY = 1024 * 2**20
"""bytes that a loop with its libraries locks at the most."""
_FAST = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "xen"}
"""Clock sources that are read without leaving the processor."""


def deadlines(root: Path) -> Iterator[Finding]:
    """Look at everything that lateness hangs on."""
    yield _scheduling()
    yield _memory()
    yield _throttling(root)
    yield _kernel(root)
    yield _cores(root)
    yield _clock(root)
    yield _governor(root)
    yield _timer_slack()


def _scheduling() -> Finding:
    about = "scheduling"
    if not hasattr(os, "sched_setscheduler"):
        return Finding(
            about, BAD, "this system has no SCHED_FIFO", "a loop on hardware is refused", "use Linux"
        )
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except PermissionError:
        most = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        return Finding(
            about,
            BAD,
            f"SCHED_FIFO {PRIORITY} is not allowed (at most {most})",
            "p99.9 of the lateness is milliseconds instead of tenths of one",
            f'echo "$USER - rtprio {PRIORITY + 10}" | sudo tee -a {LIMITS}   # then log in again',
        )
    os.sched_setscheduler(0, before[0], before[1])
    return Finding(about, GOOD, f"SCHED_FIFO {PRIORITY} is allowed")


def _memory() -> Finding:
    about, most = "locked memory", resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if most == resource.RLIM_INFINITY or most >= MEMORY or os.geteuid() == 0:
        return Finding(about, GOOD, "any amount may be locked")
    return Finding(
        about,
        BAD,
        f"at most {most / 2**20:.3g} MB may be locked",
        "a page that was swapped out costs a loop milliseconds",
        f'echo "$USER - memlock unlimited" | sudo tee -a {LIMITS}   # then log in again',
    )


def _throttling(root: Path) -> Finding:
    about = "real-time throttling"
    runtime = number(root / "proc/sys/kernel/sched_rt_runtime_us")
    period = number(root / "proc/sys/kernel/sched_rt_period_us")
    if runtime is None or period is None or runtime < 0:
        return Finding(about, GOOD, "off" if runtime is not None else "not told by this kernel")
    if runtime < 0.5 * period:
        return Finding(
            about,
            BAD,
            f"real-time processes get {runtime / 1e3:g} of {period / 1e3:g} ms",
            "a loop that needs more is stopped for the rest",
            "sudo sysctl kernel.sched_rt_runtime_us=950000",
        )
    return Finding(
        about, GOOD, f"{runtime / 1e3:g} of {period / 1e3:g} ms, which a loop that sleeps does not reach"
    )


def _kernel(root: Path) -> Finding:
    about = "kernel"
    if text(root / "sys/kernel/realtime") == "1":
        return Finding(about, GOOD, "PREEMPT_RT")
    version = text(root / "proc/version") or "unknown"
    kind = next((k for k in ("PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT") if k in version), "no preemption")
    if kind == "PREEMPT_RT":
        return Finding(about, GOOD, kind)
    return Finding(
        about,
        WEAK,
        f"{kind}, not a real-time kernel",
        "single ticks are late by up to milliseconds under load",
        "sudo apt install linux-image-rt-amd64   # Ubuntu: sudo pro enable realtime-kernel",
    )


def _cores(root: Path) -> Finding:
    about, count = "processor cores", len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    isolated = text(root / "sys/devices/system/cpu/isolated")
    if isolated:
        return Finding(about, GOOD, f"{count} to run on; isolated: {isolated}")
    if count < 2:
        return Finding(
            about,
            BAD,
            "1 to run on",
            "loop, recorder and everything else share it",
            "use a machine with two cores or more, or allow this process more (taskset -p)",
        )
    return Finding(
        about,
        WEAK,
        f"{count} to run on, none isolated",
        "other work runs on the loop's core until the loop wakes up",
        f"kernel command line: isolcpus={count - 1} nohz_full={count - 1} rcu_nocbs={count - 1}",
    )


def _clock(root: Path) -> Finding:
    about, folder = "clock source", root / "sys/devices/system/clocksource/clocksource0"
    now = text(folder / "current_clocksource")
    if now is None or now in _FAST:
        return Finding(about, GOOD, now or "not told by this kernel")
    available = (text(folder / "available_clocksource") or "").split()
    better = next((c for c in available if c in _FAST), None)
    mend = (
        f"echo {better} | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"
        if better
        else "kernel command line: tsc=reliable, where the processor's counter is constant"
    )
    return Finding(about, WEAK, now, "each look at the clock takes about a microsecond", mend)


def _governor(root: Path) -> Finding:
    about = "frequency governor"
    files = sorted((root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    found = sorted({g for f in files if (g := text(f))})
    if not found:
        return Finding(about, GOOD, "none: the frequency is not this system's to choose")
    if found == ["performance"]:
        return Finding(about, GOOD, "performance")
    return Finding(
        about,
        WEAK,
        ", ".join(found),
        "after each sleep the processor is slow for a while",
        "sudo cpupower frequency-set -g performance",
    )


def _timer_slack() -> Finding:
    about = "timer slack"
    slack = timer_slack_ns()
    if slack is None:
        return Finding(about, GOOD, "not told by this system")
    if slack <= 50_000:
        return Finding(about, GOOD, f"{slack / 1e3:g} us; none under SCHED_FIFO")
    return Finding(
        about,
        WEAK,
        f"{slack / 1e3:g} us",
        "without SCHED_FIFO sleeps end that much late",
        "start without what has set it (systemd: TimerSlackNSec=50us)",
    )
