"""The shipped Leuven configuration, identified once for all tests of the jobs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.identify import identify

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def leuven():
    return Configuration.load(ROOT / "configs" / "leuven.yaml")


@pytest.fixture(scope="session")
def identified(leuven):
    return identify(leuven)


@pytest.fixture(scope="session")
def shared_data():
    """The folder of measured recordings, or a skip that says where it was looked for."""
    given = os.environ.get("RTCOMP_SHARED")
    places = [Path(given), Path(given) / "data"] if given else [ROOT.parent / "shared" / "data"]
    for place in places:
        if (place / "real").is_dir():
            return place
    pytest.skip(f"no measured recordings in {places[0]}; set RTCOMP_SHARED to the folder that holds real/")
