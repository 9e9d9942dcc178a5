"""What the tests of the rig share: how many trials a machine may be excused from, and reports."""

from collections.abc import Sequence
from typing import Protocol

__all__ = ["MOST_EXCUSED", "judged"]

MOST_EXCUSED = 4.0
"""Trials that may say nothing because this machine itself was late, for each that is wanted; they
are not counted as good, and tried again."""


class Outcome(Protocol):
    """A trial of any kind."""

    @property
    def is_good(self) -> bool:
        """Whether the contract was kept."""

    @property
    def is_excused(self) -> bool:
        """Whether the machine itself was later than the trial was."""


def judged(trials: Sequence[Outcome], wanted: int) -> bool:
    """Return whether so many were good; fail when one was bad, or too many said nothing."""
    bad = [one for one in trials if not one.is_good and not one.is_excused]
    assert not bad, f"{len(bad)} of {len(trials)} broke the contract, first {bad[:3]}"
    excused = sum(one.is_excused for one in trials)
    most = max(2, wanted * MOST_EXCUSED)
    assert excused <= most, f"{excused} of {len(trials)} say nothing: this machine is too busy"
    return len(trials) - excused >= wanted
