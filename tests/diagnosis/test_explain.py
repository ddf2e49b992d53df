"""What was decided is held against what was put aside, and against what its own kernels leave."""

from __future__ import annotations

import pytest

from rtcomp.diagnosis.diagnose import diagnose
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import Recording


@pytest.mark.slow
def test_a_play_and_ageing_behind_it_are_named_though_their_kernels_leave_ten_times_the_floor() -> None:
    """So does the analysis of a stage that has these two and nothing else."""
    config = Configuration.load(shipped("leuven.yaml")).changed(rate=1000.0)
    play = {"name": "backlash", "gap": 8e-6, "share": 0.6}
    ageing = {"name": "stiction-ageing", "growth": 0.3, "distance": 1e-5}
    true = config.stage.with_changes(stage={"effects": [play, ageing]})
    motion = {**config.file.data["compensate"]["reference"], "duration": 60.0}
    run = closed_loop(config.changed(**true.to_dict(), reference=motion))
    columns = {k: run.columns[k] for k in ("time", "reference", "position", "voltage")}
    done = diagnose(config.stage, [Recording(columns, 1000.0)])
    assert {e.names[0] for e in done.effects} == {"backlash", "stiction-ageing"}
    assert done.fit.after < 0.3 * done.fit.retuned
