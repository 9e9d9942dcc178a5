"""Test coverage of a document: the commands, polls and messages that its tests use.

Layer 4, pure. An untested command is not reported as a problem, because the author decides which
tests are necessary.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from urc.model.driver import Driver
from urc.runtime.test_engine import Exercised, Kind

__all__ = ["Coverage", "Exercised", "measure", "summary"]

_KINDS: Final[tuple[Kind, ...]] = ("command", "poll", "message")
_NAMED_MOST: Final = 3
"""Maximum number of names in the summary; if there are more, it states their number instead."""


class Coverage(NamedTuple):
    """Test coverage of one document."""

    file: str
    total: int
    untested: tuple[Exercised, ...]
    """Untested commands, then polls, then messages, each in the order of the document."""


def measure(file: str, driver: Driver, exercised: Iterable[Exercised]) -> Coverage:
    """Return the test coverage of a driver."""
    declared: list[Exercised] = [
        *(("command", name) for name in driver.commands),
        *(("poll", poll.name) for poll in driver.polls),
        *(("message", name) for name in driver.messages),
    ]
    done = set(exercised)
    return Coverage(file, len(declared), tuple(one for one in declared if one not in done))


def summary(coverages: Iterable[Coverage]) -> str:
    """Return the untested commands, polls and messages as short text; "" if all are tested."""
    untested = [one for coverage in coverages for one in coverage.untested]
    if not untested:
        return ""
    if len(untested) <= _NAMED_MOST:
        return "no test of " + ", ".join(f"{kind} {name}" for kind, name in untested)
    counts = {kind: sum(one[0] == kind for one in untested) for kind in _KINDS}
    return "no test of " + ", ".join(
        f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count
    )
