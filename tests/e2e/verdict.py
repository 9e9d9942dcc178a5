"""The rule for trials that a busy machine makes invalid; see docs/tests.md."""

from collections.abc import Sequence
from typing import Protocol

__all__ = ["judged"]

MOST_EXCUSED = 4
"""Limit of invalid trials for each wanted one."""
FEW_EXCUSED = 9
"""Limit of invalid trials where only one or two are wanted."""


class Outcome(Protocol):
    """Result of one trial."""

    @property
    def is_good(self) -> bool:
        """Whether the promise was kept."""

    @property
    def is_excused(self) -> bool:
        """Whether a measured delay of the machine makes the trial invalid."""


def judged(trials: Sequence[Outcome], wanted: int) -> bool:
    """Return whether enough trials are valid.

    Args:
        trials: results up to now.
        wanted: number of valid trials.

    Raises:
        AssertionError: one trial broke the promise, or too many are invalid.
    """
    bad = [one for one in trials if not one.is_good and not one.is_excused]
    assert not bad, f"{len(bad)} of {len(trials)} broke the promise, first {bad[:3]}"
    excused = sum(one.is_excused for one in trials)
    most = max(FEW_EXCUSED, wanted * MOST_EXCUSED)
    assert excused <= most, f"{excused} of {len(trials)} are invalid: this machine is too busy"
    return len(trials) - excused >= wanted
