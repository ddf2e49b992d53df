"""References that are refused, each in one line: settings, files, limits."""

from __future__ import annotations

import math

import pytest

from rtcomp.control.references import Reference, check
from rtcomp.errors import ConfigError, LimitError, RecordingError


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t,reference\n0,1\n", "column 'time' is missing; found t, reference"),
        ("time,reference\n0,0\n1,1\n", "has 2 rows"),
        ("time,reference\n0,0\n1,1\n1,2\n3,3\n", "row 4; it must increase"),
        ("time,reference\n0,0\n1,nan\n2,2\n3,3\n", "row 3 is not finite"),
        ("time,reference\n0,0\n1,a\n2,2\n3,3\n", "no two numbers"),
        ("time,reference\n0,0\n1\n2,2\n3,3\n", "no two numbers"),
        (b"\x89HDF\r\n\x1a\n\xff\xfe", "is not text"),
    ],
)
def test_a_file_that_is_no_reference_is_refused_in_one_line(tmp_path, text, says):
    path = tmp_path / "bad.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(RecordingError) as caught:
        Reference.from_dict({"kind": "file", "path": str(path)})
    assert says in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(RecordingError, match="cannot be read"):
        Reference.from_dict({"kind": "file", "path": str(tmp_path / "none.csv")})


SINE = {"kind": "sine", "amplitude": 1e-3, "frequency": 1.0}


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"amplitude": 1.0}, "reference.kind is missing"),
        ({"kind": "sinus", "amplitude": 1.0, "frequency": 1.0}, "did you mean 'sine'"),
        ({**SINE, "amplitude": -1.0}, "amplitude is -1; allowed is (0, 1000]"),
        ({**SINE, "frequency": 0.0}, "frequency is 0"),
        ({**SINE, "amplitude": "1"}, "must be a number"),
        ({**SINE, "amplitude": math.nan}, "must be a finite number"),
        ({**SINE, "frequencey": 1.0}, "did you mean reference.frequency"),
        ({"kind": "sine", "amplitude": 1e-3}, "reference.frequency"),
        ({"kind": "multisine"}, "give frequencies and amplitudes"),
        ({"kind": "multisine", "frequencies": [1.0], "amplitudes": [1.0, 2.0]}, "amplitudes has 2 entries"),
        (
            {"kind": "multisine", "band": {"low": 2.0, "high": 1.0, "count": 3}, "amplitude": 1.0},
            "below high",
        ),
        ({"kind": "nested-reversals", "amplitude": 1.0}, "either speed"),
        ({"kind": "nested-reversals", "speed": 1.0}, "either amplitudes"),
        (
            {
                "kind": "minor-loops",
                "amplitude": 1.0,
                "frequency": 1.0,
                "loops": [{"position": 0.9, "size": 2.0}],
            },
            "inside +-1 m",
        ),
        ({"kind": "minor-loops", "amplitude": 1.0, "frequency": 1.0, "loops": []}, "has 0 entries"),
    ],
)
def test_wrong_settings_end_in_one_line_naming_the_key(entry, says):
    with pytest.raises(ConfigError) as caught:
        Reference.from_dict(entry)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_check_says_value_allowed_and_what_to_change():
    r = Reference.from_dict({**SINE, "duration": 5.0})
    check(r, stroke=(-1e-3, 1e-3), speed=r.peak_speed, acceleration=r.peak_acceleration)
    for limits, words in [
        ({"stroke": (-5e-4, 5e-4)}, ["0.001", "-0.0005 to 0.0005 m", "amplitude"]),
        ({"speed": 1e-3}, ["speed reaches 0.0", "allowed is 0.001 m/s", "frequency"]),
        ({"acceleration": 1e-2}, ["acceleration reaches 0.0", "allowed is 0.01 m/s^2", "frequency"]),
    ]:
        with pytest.raises(LimitError) as caught:
            check(r, **limits)
        assert all(word in str(caught.value) for word in words), caught.value
        assert "\n" not in str(caught.value)
