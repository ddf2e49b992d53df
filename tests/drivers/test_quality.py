"""When a link is too bad: more than a tenth, and at least five, of the frames of half a second."""

from __future__ import annotations

from hypothesis import example, given, settings
from hypothesis import strategies as st
from rtcomp_drivers.quality import LEAST, SHARE, WINDOW_S, LinkQuality

LATE = [(True, 0.0), *[(False, 0.03125)] * 6, *[(False, 0.046875)] * 3, (False, 0.03125)]


@settings(deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.floats(0.0, 0.05)), max_size=400))
@example([*LATE, *[(True, 0.03125)] * 2, *[(True, 0.046875)] * 2])
def test_it_never_fails_where_any_longer_stretch_is_good(frames):
    """Where no half second holds five bad frames, the link is good, however the good ones fall."""
    quality, now = LinkQuality(), 0.0
    bad_at: list[float] = []
    for bad, wait in frames:
        now += wait
        if bad:
            bad_at.append(now)
        verdict = quality.too_bad(not bad, bad, now)
        if sum(1 for t in bad_at if t > now - WINDOW_S - 1e-9) < LEAST:
            assert not verdict


def test_every_fifth_frame_bad_is_too_bad_and_every_twentieth_is_not():
    for each, expected in ((5, True), (20, False)):
        assert SHARE * 20 > 1 > SHARE * 5
        quality = LinkQuality()
        verdicts = [quality.too_bad(k % each != 0, k % each == 0, 1e-3 * k) for k in range(1, 2000)]
        assert any(verdicts) is expected


def test_what_was_long_ago_is_forgotten():
    quality = LinkQuality()
    assert not quality.too_bad(0, 4, 0.0)
    assert not quality.too_bad(0, 4, 10.0)
    assert quality.too_bad(0, 1, 10.1)
