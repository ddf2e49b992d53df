"""Shared by the tests of CAN links."""

from __future__ import annotations

import pytest
from slcan_pty import Adapter


@pytest.fixture
def adapter():
    made = Adapter()
    yield made
    made.end()
