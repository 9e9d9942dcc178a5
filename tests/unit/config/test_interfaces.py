"""Interfaces with tabs, and their pictures for who works with the left hand."""

from pathlib import Path

import pytest

from tests.unit.config.folder import WIRE, Folder, head
from urc.model.interface import Interface, Layout, Slot

SIGNALS = "signals:\n  v: { type: number }\n"
LOOK = (
    "widgets:\n  a: { use: value, bind: { value: v } }\n  b: { use: value, bind: { value: v } }\n"
)


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def interface(folder: Folder, text: str) -> Interface:
    """Return the interface that a robot declares."""
    folder.write(bot=head("robot", "bot") + WIRE + SIGNALS + LOOK + f"interfaces:\n  x: {text}\n")
    profile = folder.check("bot").profile
    assert profile is not None, folder.found("bot")
    return profile.interfaces["x"]


def test_tabs_are_pages_in_their_order(folder: Folder) -> None:
    """Each with its own pictures; what two of them show is one slot."""
    found = interface(
        folder,
        "{ tabs: { drive: { grid: a b },"
        " more_on_it: { layouts: { landscape: b, phone_portrait: b } } } }",
    )
    assert [(page.name, page.title) for page in found.pages] == [
        ("drive", "Drive"),
        ("more_on_it", "More on it"),
    ]
    assert found.pages[0].layouts == {"landscape": Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))}
    assert list(found.pages[1].layouts) == ["landscape", "phone_portrait"]
    assert found.shown == ("a", "b")


def test_an_interface_without_tabs_is_one_page(folder: Folder) -> None:
    """Which has no name, and all that the interface says."""
    found = interface(folder, "{ grid: a b, left_handed: { landscape: b a }, mirror: false }")
    (page,) = found.pages
    assert (page.name, page.is_mirrored) == ("", False)
    assert page.left_handed == {"landscape": Layout(1, 2, (Slot("b", 0, 0), Slot("a", 0, 1)))}


def test_an_interface_may_name_its_drawer(folder: Folder) -> None:
    assert interface(folder, "{ grid: a, background: b, drawer: Flippers }").drawer == "Flippers"
    assert interface(folder, "{ grid: a, background: b }").drawer == ""


def test_what_an_interface_says_of_mirroring_holds_for_its_tabs(folder: Folder) -> None:
    """Unless a tab says something else."""
    tabs = "{ one: { grid: a }, two: { grid: b, mirror: true } }"
    found = interface(folder, f"{{ mirror: false, tabs: {tabs} }}")
    assert [page.is_mirrored for page in found.pages] == [False, True]


def test_a_grid_of_another_document_gives_way_to_tabs(folder: Folder) -> None:
    """As `grids` does: there is one way of saying where everything stands."""
    folder.write(
        base=head("interface", "base") + "grid: a\n",
        x=head("interface", "x") + "extends: base.yaml\ntabs: { one: { grid: b } }\n",
    )
    assert folder.found("x") == []


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (
            "x: { tabs: { one: { grid: a } }, grid: b }",
            "misplaced-key",
            "'grid' and 'tabs' cannot be used",
        ),
        (
            "x: { tabs: { one: { title: O } } }",
            "missing-key",
            "a tab lacks 'grid'",
        ),
        (
            "x: { tabs: { one: { grid: a } }, background: a }",
            "misplaced-key",
            "is also in the grid",
        ),
        ("debug: { grid: a b }", "bad-name", "the built-in interface of every robot"),
    ],
)
def test_wrong_tabs_are_told_where_they_stand(
    folder: Folder, text: str, code: str, message: str
) -> None:
    """One finding for one fault."""
    folder.write(bot=head("robot", "bot") + WIRE + SIGNALS + LOOK + f"interfaces:\n  {text}\n")
    errors = [one for one in folder.found("bot") if one.severity == "error"]
    assert [one.code for one in errors] == [code]
    assert message in errors[0].message
