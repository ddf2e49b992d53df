"""Other forms of effects: the catalogue's kernels, fitted, leave of a foreign one more than noise does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from rtcomp import physics
from rtcomp.stage.balance import force_balance
from rtcomp.stage.stage import Stage
from rtcomp.trial.draw import Case, look
from rtcomp.trial.files import drawn
from rtcomp.trial.forces import fallen, grown, wave
from rtcomp.trial.hidden import EFFECTS, SECRETS, Rig
from rtcomp.trial.hidden.forms import FORMS, Form, in_form, is_foreign
from rtcomp.trial.plant import Run, simulate
from rtcomp.trial.stagefile import exact_stage

FREE = {
    "stribeck": ("rise", "velocity"),
    "friction-drift": ("change", "time_constant"),
    "non-congruent-friction": ("softening",),
    "torque-ripple": ("amplitude", "phase"),
    "position-dependent-friction": ("amplitude", "phase"),
    "parallel-spring": ("stiffness", "cubic"),
}
"""Parameters that are fitted; the period of a wave is its true one."""
START = {"parallel-spring": {"stiffness": 1000.0, "cubic": 0.0}, "non-congruent-friction": {"softening": 0.5}}
ALL = [(name, form) for name, forms in FORMS.items() for form in forms]
FOREIGN = [(name, form) for name, form in ALL if not form.catalogue]


@pytest.fixture(scope="module")
def axis() -> tuple[Case, Rig, Run]:
    case = drawn("micrometre", 1, "clean")
    clean = case.run("train")
    return case, look(case.physics, case.loop, case.motion, clean), clean


def error(case: Case, run: Run, effects: list[dict[str, Any]]) -> float:
    """Relative force error of the exact stage with `effects`, on the reading without noise."""
    content = exact_stage(case.bare, case.loop, case.believed)
    content["stage"]["effects"] = effects
    return force_balance(Stage.from_dict(content), run.time, run.position, run.voltage).relative_error


def best(case: Case, run: Run, name: str, start: dict[str, float], form: str) -> float:
    """The least error of the catalogue's effect in one of its forms."""
    free = FREE[name]
    scale = np.array([abs(start[key]) or 1.0 for key in free])
    fixed = {key: value for key, value in start.items() if key not in free}

    def of(x: np.ndarray) -> float:
        entry = {"name": name, **fixed, **dict(zip(free, (x * scale).tolist(), strict=True))}
        try:
            return error(case, run, [entry | ({"form": form} if form else {})])
        except Exception:
            return 1.0

    x = np.array([start[key] for key in free]) / scale
    return float(minimize(of, x, method="Nelder-Mead", options={"maxfev": 60, "fatol": 1e-6}).fun)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "form"), FOREIGN, ids=lambda v: v if isinstance(v, str) else v.name)
def test_a_foreign_form_differs_from_each_form_of_the_catalogue(
    name: str, form: Form, axis: tuple[Case, Rig, Run]
) -> None:
    case, rig, clean = axis
    sized = in_form(form, SECRETS[name], np.random.default_rng(4), rig)
    changes, parameters = sized.at(min(1.5, sized.most))
    run = simulate(case.physics._replace(**changes), case.loop, clean.reference, 1)
    floor, without = error(case, clean, []), error(case, run, [])
    start = START.get(name) or parameters
    entry = physics.build({"name": name, **start})
    fitted = {f: best(case, run, name, start, f) for f in (entry.forms or ("",))}
    print(f"{name} {form.name}: floor {floor:.4f}, without {without:.4f}, {fitted}")
    for other, left in fitted.items():
        assert left < without, other
        assert left**2 - floor**2 > (0.5 * floor) ** 2, other


def test_every_other_form_changes_what_the_plant_does(axis: tuple[Case, Rig, Run]) -> None:
    case, rig, clean = axis
    short = clean.reference[: int(4 * case.loop.rate)]
    for name, form in ALL:
        sized = in_form(form, SECRETS[name], np.random.default_rng(4), rig)
        changes, _ = sized.at(1.0)
        usual = {
            key: value for key, value in changes.items() if not key.endswith(("form", "wave", "exponent"))
        }
        usual.pop("spring_square", None)
        there = simulate(case.physics._replace(**changes), case.loop, short, 1)
        here = simulate(case.physics._replace(**usual), case.loop, short, 1)
        assert np.std(there.truth - here.truth) > 0.05 * case.loop.noise, (name, form.name)


def test_forms_are_of_effects_and_named_once() -> None:
    assert set(FORMS) <= {secret.name for secret in EFFECTS}
    for name, forms in FORMS.items():
        names = [form.name for form in forms]
        assert len(names) == len(set(names))
        assert [is_foreign(name, n) for n in names] == [not form.catalogue for form in forms]
    assert not is_foreign("stribeck", "") and not is_foreign("drive-lag", "power")


def test_forms_named_after_the_catalogue_are_its_own() -> None:
    for name, forms in FORMS.items():
        known = {entry.name: entry for entry in physics.entries()}[name].forms
        assert {form.catalogue for form in forms} - {"", "harmonics"} <= set(known)


def test_shapes() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 400)
    for form in (0.0, 1.0, 2.0):
        values = np.array([wave(a, form) for a in angles])
        assert 0.9 < np.max(np.abs(values)) < 1.3
    assert [grown(t, 10.0, 1.0) for t in (0.0, 5.0, 20.0)] == [0.0, 0.5, 1.0]
    assert [round(grown(t, 10.0, 2.0), 9) for t in (0.0, 5.0, 10.0)] == [0.0, 1.0, 0.0]
    assert [grown(t, 10.0, 3.0) for t in (0.0, 5.0, 10.0)] == [0.0, 0.0, 1.0]
    for exponent in (0.0, 0.7, 1.0, 1.5, 2.0):
        assert fallen(0.0, 1.0, exponent) == 1.0 and fallen(3.0, 1.0, exponent) < 0.2
