"""The README's pictures, from recordings as FORMATS.md has them."""

from __future__ import annotations

import importlib.util
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pytest

from rtcomp.hysteresis.interval import IntervalBasis
from rtcomp.hysteresis.model import HysteresisModel
from rtcomp.stage.stage import Stage

pytest.importorskip("matplotlib", reason="matplotlib (extra dev) draws the pictures")

TOOL = Path(__file__).resolve().parents[2] / "tools" / "make_pictures.py"
STAGE = {
    "stage": {
        "mass": 1.0,
        "force_constant": 4.0,
        "voltage_limit": 10.0,
        "friction": [{"stiffness": 2e5, "reach": 4e-6}],
    },
    "rate": 1000.0,
}


@pytest.fixture(scope="module")
def pictures() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_pictures", TOOL)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What identify and compensate leave: slow motion of a stage with one yielding spring, its true model,
    and two tracking runs."""
    folder = tmp_path_factory.mktemp("run")
    time = np.arange(4000) * 1e-3
    position = 2e-5 * np.sin(2.0 * time) * np.exp(-time / 3.0)
    model = HysteresisModel(IntervalBasis(np.array([8e-6])), np.array([2e5]))
    model.save(folder / "model.yaml")
    configuration = {"identify": {"smoothing": 0.0}, "judge": {"settle": 0.5}, "compensate": {"settle": 1.0}}
    for name, error in (("judge", 0.0), ("without", 1e-6), ("with", 1e-8)):
        with h5py.File(folder / f"{name}.h5", "w") as file:
            file["time"], file["position"] = time, position
            file["reference"] = position + error * np.sign(np.sin(2 * time) + 1e-9)
            file["voltage"] = model.response(position) / 4.0
            file.attrs["stage"] = json.dumps(Stage.from_dict(STAGE).to_dict())
            file.attrs["configuration"] = json.dumps(configuration)
            file.attrs["delay_ticks"] = 0
            file.create_group("weights")
    return folder


def test_the_loop_is_measured_friction_beside_the_frozen_model(pictures: ModuleType, run: Path) -> None:
    loop, axis = pictures.loop_of(run)
    assert axis == "linear"
    assert np.abs(loop.measured).max() == pytest.approx(0.8, rel=0.02)
    assert np.sqrt(np.mean((loop.measured - loop.model) ** 2)) < 0.02
    # Loads until sin(2 t) exp(-t / 3) turns back: tan(2 t) = 6.
    assert loop.virgin_rows == pytest.approx(1000 * np.arctan(6.0) / 2, abs=2)
    assert loop.counted == 500


def test_pictures_are_made_in_light_and_dark_and_always_the_same(
    pictures: ModuleType, run: Path, tmp_path: Path
) -> None:
    for out in ("a", "b"):
        pictures.main([str(run), str(run), "--out", str(tmp_path / out)])
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == ["compensation-dark.svg", "compensation.svg"]
    texts = [(tmp_path / "a" / name).read_text() for name in names]
    for name, text in zip(names, texts, strict=True):
        assert ET.fromstring(text).tag.endswith("svg")
        assert text == (tmp_path / "b" / name).read_text()
        assert 20_000 < len(text) < 600_000
    assert texts[0] != texts[1]


def test_the_tracking_error_leaves_out_what_the_comparison_leaves_out(
    pictures: ModuleType, run: Path
) -> None:
    tracking = pictures.tracking_of(run)
    assert tracking.time_without[0] == tracking.time_with[0] == 1.0
    assert np.abs(tracking.without) == pytest.approx(np.full(3000, 1e-6))
    assert np.abs(tracking.compensated) == pytest.approx(np.full(3000, 1e-8))


@pytest.mark.slow
def test_without_folders_the_simulated_stage_is_run_first(pictures: ModuleType, tmp_path: Path) -> None:
    pictures.main(["--out", str(tmp_path)])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["compensation-dark.svg", "compensation.svg"]


def test_one_folder_alone_is_refused(
    pictures: ModuleType, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        pictures.main([str(run)])
    assert ended.value.code == 2
    assert "give both folders, or none" in capsys.readouterr().err
