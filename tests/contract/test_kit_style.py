"""What widgets look alike in stands once, in the kit's style sheet."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.shipped import shipped

STATIC = Path(__file__).resolve().parents[2] / "urc/web/static"
FOLDERS = sorted(path for path in shipped("widgets").iterdir() if path.is_dir())
LONG = 5
"""Declarations from which on a rule that stands twice is no chance."""


def rules(css: str) -> Iterator[tuple[str, frozenset[str]]]:
    """Yield the selectors and declarations of each rule, whatever it stands in."""
    bare = re.sub(r"/\*.*?\*/", "", css, flags=re.S)
    for selector, body in re.findall(r"([^{};]+)\{([^{}]*)\}", bare):
        yield (
            selector.strip(),
            frozenset(" ".join(one.split()) for one in body.split(";") if one.strip()),
        )


KIT = list(rules((STATIC / "widgets/kit.css").read_text("utf-8")))
NAMED = {
    name
    for file in STATIC.rglob("*.css")
    for name in re.findall(r"\.(urc-[\w-]+)", file.read_text("utf-8"))
}


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_widget_writes_no_rule_of_the_kit_again(folder: Path) -> None:
    """Its template names the kit's class instead."""
    mine = rules((folder / "widget.css").read_text("utf-8"))
    known = {body: selector for selector, body in KIT if len(body) >= LONG}
    assert [(selector, known[body]) for selector, body in mine if body in known] == []


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_widget_names_only_classes_of_ours_that_there_are(folder: Path) -> None:
    """A class that no style sheet has was misspelt, or is left over."""
    page = (folder / "template.html.j2").read_text("utf-8")
    named = {
        word
        for words in re.findall(r'class="([^"]*)"', re.sub(r"{%.*?%}", " ", page))
        for word in words.split()
    }
    assert {word for word in named if word.startswith("urc-")} - NAMED == set()


def test_every_class_of_the_kit_is_used() -> None:
    """What no widget has is no part of the kit."""
    used = "".join(
        file.read_text("utf-8") for folder in FOLDERS for file in folder.iterdir() if file.is_file()
    )
    names = {name for selector, _ in KIT for name in re.findall(r"\.(urc-[\w-]+)", selector)}
    assert names
    assert {name for name in names if name not in used} == set()


@pytest.mark.parametrize(
    "file",
    sorted((*STATIC.rglob("*.css"), *shipped("widgets").rglob("*.css"))),
    ids=lambda file: f"{file.parent.name}/{file.name}",
)
def test_nothing_is_blurred(file: Path) -> None:
    """A blur over a live picture is computed anew for each image, by the processor."""
    assert not re.search(r"backdrop-filter|\bblur\(", file.read_text("utf-8"))
