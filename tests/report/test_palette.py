"""The colours stay apart for eyes that see red and green alike, on white and on dark."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rtcomp.report import palette

# Machado, Oliveira, Fernandes, IEEE TVCG 15(6), 2009: full deuteranopia and protanopia, on linear RGB.
VISION = {
    "normal": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}


def linear(colour: str) -> np.ndarray:
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    ) @ np.clip(rgb, 0.0, 1.0) / np.array([0.9505, 1.0, 1.089])  # fmt: skip
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(one: str, two: str) -> float:
    bright = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) + 0.05 for c in (one, two))
    return bright[1] / bright[0]


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("dark", [False, True])
def test_roles_stay_apart_for_every_eye(vision: str, dark: bool) -> None:
    for (a, one), (b, two) in combinations(palette.ROLES.items(), 2):
        pair = [palette.DARK[x] if dark else x for x in (one, two)]
        seen = [lab(VISION[vision] @ linear(x)) for x in pair]
        assert np.linalg.norm(seen[0] - seen[1]) > 17.0, (a, b)


@pytest.mark.parametrize("dark", [False, True])
def test_lines_and_text_stand_out_from_the_page(dark: bool) -> None:
    def shown(colour: str) -> str:
        return palette.DARK[colour] if dark else colour

    for colour in palette.ROLES.values():
        assert contrast(shown(colour), shown(palette.PAPER)) >= 3.0
    for text in (palette.INK, palette.MUTED):
        assert contrast(shown(text), shown(palette.PAPER)) >= 4.5


def test_every_colour_has_its_dark_one_and_no_two_become_one() -> None:
    used = {v for k, v in vars(palette).items() if k.isupper() and isinstance(v, str)}
    assert used == set(palette.DARK)
    assert len(set(palette.DARK.values())) == len(palette.DARK)
