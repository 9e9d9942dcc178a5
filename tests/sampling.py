"""The tests of an everyday run: a part of the contract tests and of the end-to-end tests.

Which part, `tests.effort.sampled` decides by the commit. A thorough run, and a test named on the
command line, are not sampled. docs/tests.md describes the rule.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import ceil
from typing import NamedTuple

import pytest

from tests.effort import sampled

__all__ = ["left_out"]


class Share(NamedTuple):
    """The part of the tests in a folder that an everyday run tries."""

    cases: int
    """Maximum number of parameter sets of a function; the mark `cases` sets another number."""
    functions: float = 1.0
    """Part of the functions of a file, from 0 to 1."""


SHARES: Mapping[str, Share] = {
    "/tests/unit/": Share(cases=5),
    "/tests/contract/": Share(cases=5),
    "/tests/e2e/": Share(cases=2, functions=1 / 3),
}
WHOLE = "/tests/e2e/motion/"
"""The tests of stopping: all of them, each time."""


def left_out(items: Iterable[pytest.Item]) -> set[pytest.Item]:
    """Return the tests that an everyday run does not try."""
    files: dict[str, dict[str, list[pytest.Item]]] = {}
    for item in items:
        place = item.path.as_posix()
        if WHOLE not in place:
            name = item.nodeid.partition("[")[0]
            files.setdefault(place, {}).setdefault(name, []).append(item)
    every = {item for functions in files.values() for cases in functions.values() for item in cases}
    return every - {
        item for place, functions in files.items() for item in _chosen(place, functions)
    }


def _chosen(place: str, functions: Mapping[str, Sequence[pytest.Item]]) -> list[pytest.Item]:
    share = next((share for folder, share in SHARES.items() if folder in place), None)
    if share is None:
        return [item for cases in functions.values() for item in cases]
    file = next(iter(functions)).partition("::")[0]
    names = sampled(list(functions), ceil(share.functions * len(functions)), file)
    return [
        item
        for name in names
        for item in sampled(functions[name], _most(functions[name], share), name)
    ]


def _most(cases: Sequence[pytest.Item], share: Share) -> int:
    mark = cases[0].get_closest_marker("cases")
    return int(mark.args[0]) if mark else share.cases
