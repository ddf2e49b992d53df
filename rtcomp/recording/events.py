"""What happened in a run and when: changes of the loop's state, faults, stops; a group of a recording."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rtcomp.loop.states import State

EVENT_BYTES = 256
"""Room for the text of an event; longer ones are cut."""
MOST_EVENTS = 10_000
"""Events that a file takes; after that only what ended the run."""
_CHUNK = 64


class Event(NamedTuple):
    """Something that happened."""

    time: float
    """s, from the start of the run."""
    state: int
    """Of the loop from then on, as the column ``state`` numbers it."""
    text: str


class EventLog:
    """The group ``events`` of a file being written: time (s), state and text of each."""

    def __init__(self, file: Any, columns: list[str]) -> None:
        group = file.create_group("events")
        self._sets = {
            name: group.create_dataset(name, (0,), kind, maxshape=(None,), chunks=(_CHUNK,))
            for name, kind in (("time", "f8"), ("state", "f8"), ("text", f"S{EVENT_BYTES}"))
        }
        group["time"].attrs["unit"] = "s"
        self._column = columns.index("state") if "state" in columns else -1
        self._state = -1.0

    def watch(self, rows: npt.NDArray[np.float64]) -> None:
        """Note where the state changes along `rows`, time (s) first."""
        if self._column < 0 or not len(rows):
            return
        states = rows[:, self._column]
        for k in np.flatnonzero(np.diff(states, prepend=self._state)):
            if len(self._sets["time"]) < MOST_EVENTS:
                self.add(Event(float(rows[k, 0]), int(states[k]), State(int(states[k])).name))
        self._state = float(states[-1])

    def add(self, event: Event) -> None:
        """Append one event."""
        size = len(self._sets["time"]) + 1
        values = event.time, event.state, event.text.encode()[:EVENT_BYTES]
        for dataset, value in zip(self._sets.values(), values, strict=True):
            dataset.resize((size,))
            dataset[size - 1] = value


def write_events(file: Any, events: list[Event]) -> None:
    """Write `events` into an open HDF5 file as `read_events` reads them."""
    file["events/time"] = np.array([event.time for event in events])
    file["events/state"] = np.array([float(event.state) for event in events])
    file["events/text"] = np.array([event.text.encode()[:EVENT_BYTES] for event in events], f"S{EVENT_BYTES}")
    file["events/time"].attrs["unit"] = "s"


def read_events(file: Any) -> list[Event]:
    """Return the events of an open recording, in order of time; none where it has no such group."""
    if "events" not in file:
        return []
    time, state, text = (file[f"events/{name}"][()] for name in ("time", "state", "text"))
    made = [
        Event(float(t), int(s), w.decode(errors="replace"))
        for t, s, w in zip(time, state, text, strict=False)  # a kill may leave them uneven
    ]
    return sorted(made, key=lambda event: event.time)
