"""Which commands, polls and messages of a document its own tests exercise.

Floor 4, pure. What no test exercises is no finding: a person decides what is worth a test.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from urc.model.driver import Driver
from urc.runtime.trial import Exercised, Kind

__all__ = ["Coverage", "Exercised", "measure", "summary"]

_KINDS: Final[tuple[Kind, ...]] = ("command", "poll", "message")
_NAMED_MOST: Final = 3
"""Names in the summary; more of them are counted."""


class Coverage(NamedTuple):
    """What the tests of one document exercise."""

    file: str
    total: int
    untested: tuple[Exercised, ...]
    """Commands, then polls, then messages, in the order of the document."""


def measure(file: str, driver: Driver, exercised: Iterable[Exercised]) -> Coverage:
    """Return what of a driver is exercised, and what is not."""
    declared: list[Exercised] = [
        *(("command", name) for name in driver.commands),
        *(("poll", poll.name) for poll in driver.polls),
        *(("message", name) for name in driver.messages),
    ]
    done = set(exercised)
    return Coverage(file, len(declared), tuple(one for one in declared if one not in done))


def summary(coverages: Iterable[Coverage]) -> str:
    """Return what has no test in a few words, or ""."""
    untested = [one for coverage in coverages for one in coverage.untested]
    if not untested:
        return ""
    if len(untested) <= _NAMED_MOST:
        return "no test of " + ", ".join(f"{kind} {name}" for kind, name in untested)
    counts = {kind: sum(one[0] == kind for one in untested) for kind in _KINDS}
    return "no test of " + ", ".join(
        f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count
    )
