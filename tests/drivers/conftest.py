"""Shared by the tests of drivers: a small stage, real plant servers, a board on a pty that can misbehave."""

from __future__ import annotations

import os
import select
import threading
import time
import tty

import pytest
import yaml
from free_mass import FreeMass
from rtcomp_drivers.board import Board, BoardFacts
from rtcomp_drivers.plant_process import PlantProcess

STAGE = {
    "stage": {
        "mass": 2.0,
        "force_constant": 4.0,
        "voltage_limit": 10.0,
        "viscous": 8.0,
        "friction": [{"stiffness": 3.2e5, "reach": 1.5e-6}, {"stiffness": 2.2e4, "reach": 3.5e-5}],
    },
    "sensor": {"resolution": 1e-8},
    "rate": 1000.0,
}


@pytest.fixture(scope="session")
def stage_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("stage") / "stage.yaml"
    path.write_text(yaml.safe_dump(STAGE))
    return path


@pytest.fixture
def stage(stage_file):
    from rtcomp.stage.stage import Stage

    return Stage.load(stage_file)


@pytest.fixture
def plant(stage_file):
    with PlantProcess(stage_file) as process:
        yield process


class PtyBoard:
    """A real board behind a real pty in a thread, with a line in between that can be made bad.

    `to_board` and `to_host` take the bytes of one write and return those that arrive.
    """

    def __init__(self, **facts):
        self.board = Board(FreeMass(), BoardFacts(**facts))
        self.to_board = self.to_host = lambda data: data
        self.clock = time.monotonic
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._ended = False
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        while not self._ended:
            ready = select.select([self._master], [], [], 1e-3)[0]
            now = self.clock() - self._began
            if ready:
                data = self.to_board(os.read(self._master, 4096))
                answer = self.board.receive(data, now)
            else:
                answer = self.board.run_until(now)
            answer = self.to_host(answer) if answer else b""
            if answer:
                os.write(self._master, answer)

    def unplug(self):
        if not self._ended:
            self._ended = True
            self._thread.join()
            os.close(self._master)
            os.close(self._slave)


@pytest.fixture
def pty_board():
    boards = []

    def make(**facts):
        boards.append(PtyBoard(**facts))
        return boards[-1]

    yield make
    for board in boards:
        board.unplug()
