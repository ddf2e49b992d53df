"""What every entry of the catalogue says of itself, and which values it takes, third parties' included."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from every_effect import ENTRIES, every, example, pick, put

from rtcomp import physics
from rtcomp.errors import ConfigError
from rtcomp.physics import Place
from rtcomp.stage.schema import Mechanics

# FORMATS.md, "The effects, by name": parameters and units, those that may be left out in brackets.
VOCABULARY = {
    "drive": {
        "drive-offset": "offset (V)",
        "drive-gain": "gain (1)",
        "drive-deadband": "width (V)",
        "drive-saturation": "limit (V)",
        "drive-delay": "delay (s)",
        "drive-lag": "time_constant (s)",
        "back-emf": "coefficient (N s/m)",
        "torque-ripple": "amplitude (1), period (m), phase (rad)",
        "cogging": "amplitude (N), period (m), phase (rad)",
    },
    "mechanics": {
        "inertia": "mass (kg)",
        "parallel-spring": "stiffness (N/m), cubic (N/m^3)",
        "gravity": "force (N), amplitude (N m), phase (rad)",
        "end-stop": "position (m), stiffness (N/m)",
        "backlash": "gap (m), share (1), contact (Hz)",
        "resonance": "frequency (Hz), damping (1), mass_ratio (1)",
    },
    "friction": {
        "viscous-friction": "coefficient (N s/m)",
        "quadratic-drag": "coefficient (N s^2/m^2)",
        "asymmetric-friction": "asymmetry (1), closing (1)",
        "asymmetric-viscous-friction": "ratio (1)",
        "stribeck": "rise (1), velocity (m/s), stiffening (1), following (1)",
        "position-dependent-friction": "amplitude (1), period (m), phase (rad), slope (1/m), "
        "stiffening (1), following (1)",
        "load-dependent-friction": "coefficient (1), external (1), stiffening (1), following (1)",
        "non-congruent-friction": "softening (1)",
        "frictional-lag": "time_constant (s), stiffening (1), following (1)",
        "stiction-ageing": "growth (1), distance (m), onset (s), stiffening (1), following (1)",
        "friction-drift": "change (1), time_constant (s)",
        "creep": "fraction (1), time_constant (s)",
        "bouc-wen": "alpha (N/m), beta (1/m), gamma (1), delta (1), exponent (1)",
    },
    "sensor": {
        "sensor-scale": "scale (1)",
        "sensor-delay": "delay (s)",
        "sensor-periodic-error": "amplitude (m), period (m), phase (rad)",
        "sensor-drift": "drift (m), time_constant (s)",
        "sensor-jump": "size (m), time (s)",
    },
    "disturbance": {
        "tonal-disturbance": "amplitude (N), frequency (Hz), phase (rad)",
        "constant-force": "force (N)",
    },
    "open": {"position-force": ""},
}


@every
def test_text_is_complete(entry):
    for field in ("says", "equation", "source", "signature", "experiment"):
        text = getattr(entry, field)
        assert text == text.strip() and text, field
        assert not text.endswith("."), f"{field} stands inside sentences"
        assert "TODO" not in text
    for field in ("says", "signature", "experiment"):
        assert len(getattr(entry, field).split()) >= 3, field
    assert "=" in entry.equation or "<-" in entry.equation
    assert entry.__doc__ and entry.__doc__.strip().endswith(".")
    for parameter in (*entry.parameters, *entry.element):
        assert re.fullmatch(r"[a-z]+(_[a-z]+)*", parameter.name)
        assert parameter.unit and parameter.says.strip()
        assert math.isfinite(parameter.low) and math.isfinite(parameter.high)
        assert parameter.low < parameter.high
        if parameter.default is not None:
            assert parameter.check(parameter.default, entry.name) == parameter.default


@every
def test_what_a_search_reads_fits_its_parameters(entry):
    known = {p.name: p for p in entry.parameters}
    assert set(entry.linear) <= set(known) and not any(known[name].choice for name in entry.linear)
    if entry.neutral is not None:
        assert set(entry.linear) <= set(entry.neutral) <= set(known)
    for name, values in entry.search_grid.items():
        scaled = known[name].unit == "1" or list(values) == [known[name].default]
        assert scaled, "a unit gives the others their scale, or their default does"
        assert len(values) > 0 and list(values) == sorted(values)
        for value in values:
            known[name].check(value, entry.name)
    for parameter in (*entry.parameters, *entry.element):
        assert parameter.low <= parameter.lowest < parameter.high
    assert entry.stands_for == "" or entry.stands_for in Mechanics.model_fields
    assert not entry.steady or entry.place is Place.DRIVE
    assert not entry.whole_friction or entry.place is Place.FRICTION
    assert not entry.moving_mass or entry.place is Place.MECHANICS


@every
def test_a_missing_effect_has_neutral_values(entry):
    """Without them nobody could say whether an interval holds the values that change nothing."""
    if entry.searchable and entry.name != "inertia":  # its neutral value is the believed mass
        assert entry.neutral


@every
def test_name_and_parameters_are_those_of_the_vocabulary(entry):
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", entry.name)
    assert physics.entry(entry.name) is entry
    assert isinstance(entry.place, Place)
    for place, effects in VOCABULARY.items():
        if entry.name in effects:
            assert place in (entry.place.name.lower(), "open")
            assert ", ".join(f"{p.name} ({p.unit})" for p in entry.parameters) == effects[entry.name]


def test_names_are_unique_and_a_wrong_one_finds_the_nearest():
    assert len({e.name for e in ENTRIES}) == len(ENTRIES)
    with pytest.raises(ConfigError, match="no effect is named 'coging'; did you mean 'cogging'"):
        physics.build({"name": "coging"})
    with pytest.raises(ConfigError, match="needs a name"):
        physics.build({"amplitude": 1.0})
    with pytest.raises(ValueError, match="already has"):
        physics.register(ENTRIES[0])


@every
def test_it_goes_through_its_dictionary_unchanged(entry):
    effect = example(entry)
    text = effect.to_dict()
    assert text["name"] == entry.name
    again = physics.build(text)
    assert type(again) is entry
    assert again == effect
    assert again.to_dict() == text
    np.testing.assert_array_equal(again.vector(), effect.vector())
    assert type(effect).__name__ in repr(effect)


@every
def test_its_forms_are_named_in_its_dictionary(entry):
    plain = example(entry)
    assert "form" not in plain.to_dict()
    if not entry.forms:
        with pytest.raises(ConfigError, match="unknown parameter 'form'"):
            example(entry, form="level")
        return
    first, *others = entry.forms
    assert others and entry.forms[first] is entry.kernel is plain.kernel
    assert example(entry, form=first) == plain and plain.form == first
    for form in others:
        effect = example(entry, form=form)
        text = effect.to_dict()
        assert text["form"] == effect.form == form and effect.kernel is entry.forms[form]
        assert physics.build(text) == effect != plain
        assert form in repr(effect)
        with pytest.raises(ConfigError, match=rf"form is '{form}x'; did you mean '{form}'") as caught:
            example(entry, form=form + "x")
        assert caught.value.key == ("form",)
    for wrong in (1.0, True, ["level"]):
        with pytest.raises(ConfigError, match="form is"):
            example(entry, form=wrong)


def wrong_values(parameter):
    yield math.nan
    yield math.inf
    yield -math.inf
    yield parameter.high * 2
    yield parameter.low if parameter.open_low else parameter.low - max(1.0, abs(parameter.low))


@every
def test_wrong_values_are_refused_by_name_value_and_range(entry):
    text = example(entry).to_dict()
    places = [((p.name,), p) for p in entry.parameters]
    if entry.element:
        list_name = next((key for key, value in text.items() if isinstance(value, list)), None)
        if list_name:
            places += [((list_name, 0, p.name), p) for p in entry.element]
    for path, parameter in places:
        for value in wrong_values(parameter):
            with pytest.raises(ConfigError) as caught:
                physics.build(put(text, path, value))
            message = str(caught.value)
            assert parameter.name in message and f"{value:g}" in message
            high = parameter.highest(getattr(example(entry), "form", ""))
            assert f"{parameter.low:g}, {high:g}]" in message
            assert "\n" not in message
        for value in ("many", None, True, [1.0]):
            with pytest.raises(ConfigError, match=parameter.name):
                physics.build(put(text, path, value))
        misspelt = put(text, path, None)
        pick(misspelt, path[:-1]).pop(path[-1])
        pick(misspelt, path[:-1])[parameter.name + "x"] = 1.0
        with pytest.raises(ConfigError, match=f"unknown parameter '{parameter.name}x'.*{parameter.name}"):
            physics.build(misspelt)


@every
def test_a_missing_parameter_is_named(entry):
    for parameter in entry.parameters:
        text = example(entry).to_dict()
        del text[parameter.name]
        if parameter.default is None:
            with pytest.raises(ConfigError, match=rf"'{parameter.name}' \(.+\) is missing"):
                physics.build(text)
        else:
            assert physics.build(text).values[parameter.name] == parameter.default
