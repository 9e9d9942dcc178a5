"""How many examples a property is tried on, and which cases of a large table are tried.

The everyday run is quick; ``URC_THOROUGH=1`` tries twelve times as many examples, and all cases.
``./dev bench --full tests_thorough`` runs all these tests in this way. ``URC_ALL_CASES=1`` tries
all cases with the everyday number of examples; `./dev mutate` sets it.
"""

import os
import random
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

__all__ = ["IS_THOROUGH", "examples", "sampled", "seed"]

IS_THOROUGH = bool(os.environ.get("URC_THOROUGH"))
_HAS_ALL_CASES = IS_THOROUGH or bool(os.environ.get("URC_ALL_CASES"))


_Case = TypeVar("_Case")


def examples(thorough: int) -> int:
    """Return the number for this run, out of the number for a thorough one."""
    return thorough if IS_THOROUGH else max(10, thorough // 12)


def sampled(cases: Sequence[_Case], most: int, table: str = "") -> list[_Case]:
    """Return at most `most` cases in their order, chosen by the commit; all in a thorough run.

    Each commit tries other cases. The same commit tries the same ones on each machine and in each
    process, so a failure can be repeated. Tables with different names have independent samples.
    """
    if _HAS_ALL_CASES or len(cases) <= most:
        return list(cases)
    choose = random.Random(seed() + table)  # noqa: S311 - selects tests
    return [cases[number] for number in sorted(choose.sample(range(len(cases)), most))]


@cache
def seed() -> str:
    """Return the hash of the commit, or of ``URC_TEST_SEED``; "" outside a checkout."""
    if given := os.environ.get("URC_TEST_SEED"):
        return given
    root = Path(__file__).resolve().parents[1]
    command = ["git", "rev-parse", "HEAD"]
    try:
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return done.stdout.strip()
