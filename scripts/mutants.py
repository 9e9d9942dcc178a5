"""Mutants and results as stored by mutmut, and the explanations for surviving mutants."""

import json
import re
import tomllib
from collections.abc import Iterator
from difflib import unified_diff
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from scripts.mutation_copy import PLAIN, Settings

__all__ = ["DEAD", "Explained", "Kind", "Mutant", "explained_in", "mutants_in", "table"]

_STATUS = {
    None: "waiting",
    0: "survived",
    1: "killed",
    3: "killed",  # pytest itself failed
    -1: "killed",  # a test's signal, which the mutant did not handle
    -15: "killed",
    5: "no tests",
    33: "no tests",
    24: "timeout",
    -24: "timeout",
    36: "timeout",
    152: "timeout",
    255: "timeout",
}
"""Status of a mutant, by mutmut's exit code; other exit codes mean `odd`."""
STATUSES = ("killed", "timeout", "survived", "no tests", "odd", "waiting")
DEAD = ("killed", "timeout")
"""Statuses of detected mutants: at least one test failed or timed out."""
_COMMENT = re.compile(r"  # .*")
Change = tuple[str, str]
"""The removed and inserted code of a mutant."""


class Mutant:
    """A mutant: one small change of one function."""

    def __init__(self, folder: Path, module: str, name: str, status: str) -> None:
        # mutmut names are like ``urc.guard.motion_scheduler.xǁMotionSchedulerǁtick__mutmut_3``.
        self._folder = folder
        self.module = module
        self.name = name
        self.status = status

    @property
    def function(self) -> str:
        """Changed function, such as ``urc.guard.motion_scheduler.MotionScheduler.tick``."""
        inner = self.name.removeprefix(f"{self.module}.").partition("__mutmut_")[0]
        plain = inner.replace("ǁ", ".").removeprefix("x.").removeprefix("x_")
        return f"{self.module}.{plain.removesuffix(PLAIN)}"

    @cached_property
    def change(self) -> Change:
        """Removed and inserted code, without indentation and trailing comments."""
        before, after = [], []
        for line in self._diff():
            if line.startswith("-"):
                before.append(_COMMENT.sub("", line[1:]).strip())
            elif line.startswith("+"):
                after.append(_COMMENT.sub("", line[1:]).strip())
        return "\n".join(before), "\n".join(after)

    @property
    def shown(self) -> str:
        """The change as a diff with the surrounding lines."""
        return f"  {self.function}\n" + "\n".join(f"  {line}" for line in self._diff())

    def _diff(self) -> list[str]:
        path = self._folder / (self.module.replace(".", "/") + ".py")
        spans = json.loads(Path(f"{path}.spans").read_text("utf-8"))["spans"]
        lines = path.read_text("utf-8").splitlines()
        name = self.name.removeprefix(f"{self.module}.")
        base = name.partition("__mutmut_")[0]

        def text(one: str) -> list[str]:
            start, end = spans[one]
            return [line.replace(one, base) for line in lines[start - 1 : end]]

        before, after = text(f"{base}__mutmut_orig"), text(name)
        return list(unified_diff(before, after, lineterm="", n=2))[2:]


class Kind(NamedTuple):
    """A category of mutants that are harmless for the same reason."""

    before: re.Pattern[str]
    """Pattern that must match the entire removed code."""
    after: str
    """Template of the inserted code, with references to the groups of `before`."""

    def fits(self, change: Change) -> bool:
        """Return whether a change belongs to this category."""
        found = self.before.fullmatch(change[0])
        return found is not None and found.expand(self.after) == change[1]


class Explained(NamedTuple):
    """Explanations for surviving mutants: why no test needs to kill them."""

    reasons: dict[tuple[str, Change], str]
    """Reason why a mutant is harmless, by function and change."""
    kinds: tuple[Kind, ...] = ()

    def covers(self, mutant: Mutant) -> bool:
        """Return whether a reason or a category explains why a mutant is harmless."""
        known = (mutant.function, mutant.change) in self.reasons
        return known or any(kind.fits(mutant.change) for kind in self.kinds)

    def unused(self, mutants: list[Mutant]) -> Iterator[str]:
        """Yield the explanations that match no surviving or untested mutant."""
        lives = {(one.function, one.change) for one in mutants if one.status not in DEAD}
        for function, (before, after) in sorted(self.reasons.keys() - lives):
            yield f"{function}: {before} -> {after}"


def explained_in(path: Path) -> Explained:
    """Read the explanations for harmless mutants from a TOML file.

    Raises:
        KeyError, TypeError, ValueError: an entry is invalid.
    """
    told = tomllib.loads(path.read_text("utf-8"))
    reasons = {
        (entry["function"], (before, after)): entry["why"]
        for entry in told.get("mutant", [])
        for before, after in entry["changes"]
    }
    kinds = (Kind(re.compile(one["before"]), one["after"]) for one in told.get("kind", []))
    return Explained(reasons, tuple(kinds))


def mutants_in(copy: Path, settings: Settings) -> list[Mutant]:
    """Return all mutants that mutmut has generated in `copy`, with their statuses."""
    folder = copy / "mutants"
    found = []
    for path in sorted(folder.rglob("*.py.meta")):
        source = path.relative_to(folder).as_posix().removesuffix(".meta")
        if settings.is_mutated(source):
            module = source.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
            codes = json.loads(path.read_text("utf-8"))["exit_code_by_key"]
            found += [
                Mutant(folder, module, name, _STATUS.get(code, "odd"))
                for name, code in codes.items()
            ]
    return found


def table(mutants: list[Mutant], explained: Explained) -> Iterator[str]:
    """Yield a line of the table for each module, then a line with the totals."""
    heads = [*STATUSES[:3], "explained", *STATUSES[3:]]
    yield f"{'':<28}" + "".join(f"{head:>10}" for head in [*heads, "all", "killed %"])
    modules = sorted({one.module for one in mutants})
    for module in [*modules, ""]:
        those = [one for one in mutants if module in ("", one.module)]
        counts = {status: sum(one.status == status for one in those) for status in STATUSES}
        lives = [one for one in those if one.status not in (*DEAD, "waiting")]
        counts["explained"] = sum(map(explained.covers, lives))
        killed = sum(counts[status] for status in DEAD)
        tried = len(those) - counts["waiting"]
        share = f"{100 * killed / tried:.1f}" if tried else "-"
        cells = [*(counts[head] for head in heads), len(those), share]
        yield f"{module or 'all':<28}" + "".join(f"{cell:>10}" for cell in cells)
