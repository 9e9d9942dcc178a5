"""No example shows a robot that moves without saying so: readers copy what they see."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.documentation import ROOT, Block, blocks
from urc.config.rules.unmarked import why_it_moves
from urc.model.driver import Argument, Command
from urc.model.payload import WriteSpec

CODES = ROOT / "docs" / "reference" / "codes.md"
"""Made from the pages of `urc explain`, whose examples are wrong on purpose."""
PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")} - {CODES})
MARKS = frozenset(("hold", "moves", "stop"))


def commands_of(block: Block) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the commands and sequences of a fenced block, which may be a piece of a document."""
    try:
        data = yaml.safe_load(block.text)
    except (yaml.YAMLError, ValueError):  # one that shows what YAML makes of it
        return
    inside = data.get("driver") if isinstance(data, dict) else None
    for document in (data, inside):
        for key in ("commands", "sequences"):
            found = document.get(key) if isinstance(document, dict) else None
            for name, one in (found if isinstance(found, dict) else {}).items():
                steps = {"steps": one} if isinstance(one, list) else one
                if isinstance(steps, dict) and not {"send", "steps"}.isdisjoint(steps):
                    yield name, steps


def as_command(name: str, data: dict[str, Any]) -> Command:
    """Return what the rule looks at: arguments with their units, and the type of a message."""
    args = data.get("args") or {}
    named = {str(one): (what or {}).get("unit", "") for one, what in args.items()}
    arguments = {one: Argument(one, unit=unit) for one, unit in named.items()}
    send = data.get("send")
    verb, attributes = next(iter(send.items())) if isinstance(send, dict) else ("", {})
    options = {"verb": verb, "attributes": attributes}
    return Command(name, "", WriteSpec("envelope", options), arguments)


def unmarked(page: Path) -> list[str]:
    """Return the place, name and reason of each command that looks like motion without a mark."""
    return [
        f"{block}: {name}: {why}"
        for block in blocks(page)
        if block.language == "yaml"
        for name, command in commands_of(block)
        if MARKS.isdisjoint(command) and (why := why_it_moves(name, as_command(name, command)))
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_example_of_a_page_moves_a_robot_without_a_mark(page: Path) -> None:
    """Each says `hold`, `moves` or `stop`, so that STOP of a copied robot works."""
    assert unmarked(page) == []


def test_the_look_at_examples_is_not_blind() -> None:
    """`urc explain unmarked-motion` shows one on purpose, and it is found."""
    assert any("a speed in m/s" in one or "'drive'" in one for one in unmarked(CODES))
