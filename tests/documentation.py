"""The fenced blocks of README.md and the pages, for the tests that hold them to what they say."""

import re
import shlex
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import yaml

ROOT = Path(__file__).resolve().parents[1]
TUTORIAL = ROOT / "docs" / "tutorial.md"
"""Has a test of its own, tests/e2e/test_tutorial.py, which does all that it says, in its order."""
FOLDERS = (".", "install", "tutorials", "how-to", "explanation")
"""Folders below docs/ whose pages are read here; the other pages have tests of their own."""
PAGES = (
    ROOT / "README.md",
    *sorted({page for one in FOLDERS for page in (ROOT / "docs" / one).glob("*.md")} - {TUTORIAL}),
)

_BLOCK = re.compile(r"^```(\w+)(?: ([\w./-]+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """One fenced block."""

    page: Path
    line: int
    """1-based, of the opening fence."""
    language: str
    file: str
    """The file of a widget that it is, when the fence says so: ```` ```js lamp/widget.js ````."""
    text: str

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """The lines of a shell block, without their comments."""
        found = [re.sub(r"\s+#.*", "", line).strip() for line in self.text.splitlines()]
        return [line for line in found if line]


def blocks(page: Path) -> list[Block]:
    """Return every fenced block of a page, in order."""
    text = page.read_text("utf-8")
    return [
        Block(page, text.count("\n", 0, found.start()) + 1, found[1], found[2] or "", found[3])
        for found in _BLOCK.finditer(text)
    ]


def is_piece(block: Block) -> bool:
    """Return whether a longer block of the same page holds this one, line for line."""
    return any(
        other.page == block.page and len(other.text) > len(block.text) and block.text in other.text
        for other in BLOCKS
    )


BLOCKS = [block for page in PAGES for block in blocks(page)]
YAML = [block for block in BLOCKS if block.language == "yaml"]
RULES = [block for block in YAML if "\nkind: site-rules\n" in block.text]
WHOLE = [block for block in YAML if block.text.startswith("urc: 1\n") and not is_piece(block)]
DOCUMENTS = [block for block in WHOLE if block not in RULES]


def answers() -> Iterator[tuple[list[str], Block]]:
    """Yield the words of each command that stands alone, with the block that shows its output."""
    for asked, answer in pairwise(BLOCKS):
        is_answered = asked.page == answer.page and answer.language == "text"
        if asked.language == "sh" and len(asked.commands) == 1 and is_answered:
            yield shlex.split(asked.commands[0]), answer


def write_files(folder: Path) -> Path:
    """Write all that the pages show, as a reader would; return the folder with their widgets."""
    widgets = folder / "widgets"
    for block in BLOCKS:
        if block.file:
            path = widgets / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, "utf-8")
    for block in DOCUMENTS:
        if not block.file:
            name = yaml.safe_load(block.text)["name"]
            (folder / f"{name}.yaml").write_text(block.text, "utf-8")
    return widgets
