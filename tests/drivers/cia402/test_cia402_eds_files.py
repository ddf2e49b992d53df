"""EDS files from elsewhere: those that lack what the driver needs, and files that are none."""

from __future__ import annotations

import pytest
from drives_on_a_bus import in_vain
from refusals import in_one_line
from rtcomp_drivers.cia402_objects import EDS, eds_text

from rtcomp.errors import ConfigError


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ("6071", ["no 6071h", "torque mode"]),
        ("6064", ["no 6064h"]),
        ("1A00sub2", ["no 1A00h:2"]),
        ("1016sub1", ["no 1016h:1", "drive_watchdog"]),
        ("6076", ["no 6076h", "rated_torque"]),
    ],
)
def test_an_eds_without_what_is_needed(tmp_path, section, says):
    head, _, rest = eds_text().partition(f"[{section}]\n")
    _, _, rest = rest.partition("\n\n")
    index = section[:4]
    if len(section) == 4:
        head = "\n".join(line for line in head.split("\n") if not line.endswith(f"=0x{index}"))
    path = tmp_path / "without.eds"
    path.write_text(head + rest)
    in_one_line(ConfigError, [str(path), *says], in_vain(eds=str(path)))


def test_an_eds_with_other_types(tmp_path):
    path = tmp_path / "other.eds"
    path.write_text(
        eds_text().replace(
            "Target torque\nObjectType=0x7\nDataType=0x0003", "Target torque\nObjectType=0x7\nDataType=0x0004"
        )
    )
    in_one_line(ConfigError, ["6071h has data type 0004h"], in_vain(eds=str(path)))


@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 50, b"not an eds\n", b"[1000]\nParameterName=x\n"])
def test_files_that_are_no_eds(tmp_path, content):
    path = tmp_path / "broken.eds"
    path.write_bytes(content)
    in_one_line(ConfigError, [str(path)], in_vain(eds=str(path)))
    other = tmp_path / "drive.txt"
    other.write_text(EDS.read_text())
    in_one_line(ConfigError, ["no EDS file"], in_vain(eds=str(other)))
