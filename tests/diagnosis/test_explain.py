"""What was decided is held against what was put aside, and against what its own kernels leave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded import STAGE, cut, run, stage

from rtcomp.control.references import Reference
from rtcomp.diagnosis.pipeline import diagnose
from rtcomp.jobs.configuration import Configuration
from rtcomp.jobs.demo import shipped
from rtcomp.jobs.simulate import closed_loop
from rtcomp.recording.reader import Recording, read
from rtcomp.stage.stage import Stage
from rtcomp.trial.draw import Plan, draw
from rtcomp.trial.stagefile import write_recording
from rtcomp.yamlfile import dump_yaml


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


def test_contacts_that_were_loaded_before_the_recording_hide_no_dead_band() -> None:
    """It begins with small motion, as a multisine that fades in does, on an axis that came from elsewhere."""
    weightless = [{"stiffness": 1e-13, "reach": reach} for reach in (4.5e-5, 5e-5)]
    friction = [*STAGE["stage"]["friction"], {"stiffness": 1e4, "reach": 4e-5}]
    true = stage(friction=friction, effects=[{"name": "drive-deadband", "width": 0.4}])
    band = {"low": 0.11, "high": 2.2, "count": 7}
    searching = {"kind": "multisine", "band": band, "amplitude": 2.6e-4, "duration": 23.0}
    came = 2e-4 * np.sin(np.linspace(0.0, 0.8 * np.pi, 1500))
    then = Reference.from_dict(searching).evaluate(np.arange(23_000) * 1e-3)[0]
    recording = cut(run(true, np.concatenate([came, came[-1] + then])), 1500, 24_500)
    done = diagnose(stage(friction=[*friction, *weightless]), [recording])
    assert [e.names for e in done.effects] == [("drive-deadband",)]
    assert done.fit.after < 0.1 * done.fit.retuned


@pytest.mark.slow
def test_rests_that_begin_with_readings_half_a_count_off_are_no_ageing(tmp_path: Path) -> None:
    """Friction gives way over 78 counts. Ageing takes four tenths of the error off, and may be none."""
    case = draw(Plan("case", "clean", (), "full", 1292388983252871617))
    dump_yaml(tmp_path / "stage.yaml", case.believed)
    write_recording(tmp_path / "train.csv.gz", case.run("train"), case.loop)
    done = diagnose(Stage.load(tmp_path / "stage.yaml"), [read(tmp_path / "train.csv.gz")])
    assert done.verdict == "consistent"
    assert not done.effects
