"""Mistakes as newcomers make them: each is found at its place, and nearly each hint mends it.

`tests/newcomers/mistakes.toml` holds the mistakes, and `tests/remedies.py` follows the hints.
"""

import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.remedies import apply
from urc.config.load import WidgetFolder, check
from urc.problems import Problem
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

HOME = Path(__file__).parents[1] / "newcomers"
MOST_ROUNDS = 8
"""A mistake in a line may hide others behind it; each round follows one hint."""
UNMENDED = {
    "template-for": "no template without a loop does the same",
    "look-ahead": "no pattern without it does the same",
    "port-too-large": "only the robot's sheet tells the right port",
    "argument-missing": "no name resembles the unknown one",
    "text-for-number": "only the writer knows the number",
}
"""Mistakes whose hint says what is wrong, but not what is right."""


class Mistake(NamedTuple):
    """A mistake in one of the good documents."""

    name: str
    text: str
    """The wrong document."""
    place: tuple[int, int]
    """Line and column of the mistake, 1-based."""


def mistakes() -> list[Mistake]:
    made = []
    for name, one in tomllib.loads((HOME / "mistakes.toml").read_text("utf-8")).items():
        good = (HOME / f"{one['base']}.yaml").read_text("utf-8")
        assert good.count(one["find"]) >= 1, name
        start = good.index(one["find"])
        text = good.replace(one["find"], one["write"], 1)
        at = text.find(one["at"], start)
        if not one["write"] and start:  # of what is missing, the key above
            at = text.rindex(one["at"], 0, start)
        line_start = text.rfind("\n", 0, at) + 1
        made.append(Mistake(name, text, (text.count("\n", 0, at) + 1, at - line_start + 1)))
    return made


MISTAKES = mistakes()


def problems_of(text: str, name: str) -> list[Problem]:
    """Return the problems of a document, and of its tests; errors first."""
    file = Path(f"{name}.yaml")
    file.write_text(text, "utf-8")
    checked = check(str(file), built_in_catalog(), WidgetFolder(shipped("widgets")))
    found = [one for one in checked.problems if one.code != "name-mismatch"]
    if checked.profile is not None and not found:
        found += exercise(checked.profile).problems
    return sorted(found, key=lambda one: one.severity != "error")


def is_mended(mistake: Mistake) -> bool:
    """Follow one hint after the other; return whether the document is then without problems."""
    text = mistake.text
    for _ in range(MOST_ROUNDS):
        problems = problems_of(text, mistake.name)
        if not problems:
            return True
        before = text
        for problem in problems:
            text = apply(before, problem)
            if text != before:
                break
        if text == before:
            return False
    return False


@pytest.mark.parametrize("base", ["cart", "scout", "base"])
def test_good_documents_have_no_problem(
    base: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert problems_of((HOME / f"{base}.yaml").read_text("utf-8"), base) == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda one: one.name)
def test_mistake_is_reported_at_its_place(
    mistake: Mistake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line always, and a caret at or within the wrong text."""
    monkeypatch.chdir(tmp_path)
    places = {(one.line, one.column) for one in problems_of(mistake.text, mistake.name)}
    assert mistake.place in places


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda one: one.name)
def test_hint_mends_the_mistake(
    mistake: Mistake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A document that a script has mended by its hints has no error, and its tests pass."""
    monkeypatch.chdir(tmp_path)
    assert is_mended(mistake) is (mistake.name not in UNMENDED)


def test_there_are_enough_mistakes() -> None:
    """The collection may grow, not shrink; a script can follow nine hints of ten."""
    assert len(MISTAKES) >= 90
    assert UNMENDED.keys() <= {one.name for one in MISTAKES}
    assert len(UNMENDED) <= len(MISTAKES) // 10
