"""No damaged frame passes for a right one, and both decoders say so."""

from __future__ import annotations

import pytest
from tests.fuzz import damage


@pytest.mark.parametrize("pattern", damage.PATTERNS)
def test_every_damaged_frame_is_noticed(pattern: str) -> None:
    counts = damage.count(pattern, 200_000)
    assert counts.damaged == 200_000
    assert counts.undetected == 0
    assert counts.harmless == 0


@pytest.mark.parametrize("pattern", damage.PATTERNS)
def test_both_decoders_see_the_same(pattern: str) -> None:
    assert damage.disagreement(pattern, 1_500) == ""


def test_whole_frames_are_among_them() -> None:
    accepted = [verdict.accepted for verdict in damage.verdicts("bits_1", 300)]
    assert sum(map(bool, accepted)) > 50
