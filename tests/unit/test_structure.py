"""`python -m scripts.structure`: what each figure counts."""

from pathlib import Path

import pytest

from scripts.structure import Structure, javascript, modules, structure, table


def measured(root: Path, **files: str) -> Structure:
    """Return the figures of a tree whose `urc/NAME.py` have these texts."""
    folder = root / "urc"
    folder.mkdir(exist_ok=True)
    for name, text in {"__init__": "", **files}.items():
        (folder / f"{name}.py").write_text(text, "utf-8")
    return structure(modules(root, "urc"))


def test_lines_are_told_apart(tmp_path: Path) -> None:
    """A blank line within a docstring is docstring; a comment behind code is both."""
    found = measured(tmp_path, one='"""One.\n\nTwo.\n"""\n\nx = 1  # why\n# alone\n')
    lines = found.lines
    assert (lines.total, lines.code, lines.blank, lines.docstring) == (7, 2, 1, 4)
    assert lines.comments == 2
    assert dict(table(found))["comments per 100 lines"] == "28.6"


def test_importers_are_counted_by_module(tmp_path: Path) -> None:
    """Inner imports and entries of tables count; an import of oneself and packages do not."""
    found = measured(
        tmp_path,
        a="from urc import b\nimport urc.c\n",
        b="def f():\n    from urc.c import x\n    import urc.b\n",
        c="TABLE = 'urc.d:make'\n",
        d="import json\n",
    )
    assert found.one_importer == ["urc.b", "urc.d"]


def test_class_names_are_counted_where_they_stand_twice(tmp_path: Path) -> None:
    """Public names and private ones apart, with their places."""
    found = measured(tmp_path, a="class X: ...\nclass _P: ...\nclass Y: ...\n", b="class X: ...\n")
    assert found.public_twice == {"X": ["urc/a.py:1", "urc/b.py:1"]}
    assert found.private_twice == {}
    assert found.classes == 4
    again = measured(tmp_path, b="class _P: ...\n")
    assert (again.public_twice, list(again.private_twice)) == ({}, ["_P"])


@pytest.mark.parametrize(("statements", "is_long"), [(59, False), (60, True)])
def test_a_function_is_long_from_sixty_one_lines(
    tmp_path: Path, statements: int, is_long: bool
) -> None:
    """The line of its name counts; decorators do not."""
    text = "@wrapped\ndef f():\n" + "    g()\n" * statements
    assert bool(measured(tmp_path, a=text).long_functions) is is_long


FIRST = """
def f(a):
    '''Do it.'''
    b = a.start(1)
    if b > 2:
        b.stop()
    return b
"""
COPY = FIRST.replace("b", "other").replace("2", "77").replace("Do it", "Something else")


@pytest.mark.parametrize(
    ("second", "lines"),
    [
        (COPY, 4),
        (COPY.replace("stop", "go"), 0),
        (COPY.replace("77", "len(a)"), 0),
        (COPY.replace("    return other\n", ""), 0),
    ],
)
def test_repeats_are_found_under_other_names(tmp_path: Path, second: str, lines: int) -> None:
    """Variables, constants and docstrings may differ; methods, shapes and shorter runs may not."""
    assert measured(tmp_path, a=FIRST, b=second).repeated == lines


def test_alike_rows_of_one_function_are_no_repeat(tmp_path: Path) -> None:
    """A constructor that sets ten attributes copies nothing."""
    text = "def f(a):\n" + "".join(f"    x{number} = a\n" for number in range(10))
    assert measured(tmp_path, a=text).repeated == 0


def test_javascript_of_others_is_not_counted(tmp_path: Path) -> None:
    """Modules of npm are no lines of ours."""
    for name in ("a.js", "node_modules/b.js", "vendor/c.js"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("one;\ntwo;\n", "utf-8")
    assert javascript(tmp_path) == 2
