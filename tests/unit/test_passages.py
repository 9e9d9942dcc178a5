"""The prose of the tree: its passages and sentences, and how sentences are drawn."""

import pytest

from scripts.passages import is_read, passages, sentences
from scripts.sentences import candidates, draw


def found(path: str, text: str) -> list[tuple[int, str, str]]:
    """Return (line, kind, sentence) of a file."""
    return [
        (one.line, one.kind, one.text)
        for passage in passages({path: text})
        for one in sentences(passage)
    ]


@pytest.mark.parametrize(
    ("path", "is_prose"),
    [
        ("README.md", True),
        ("docs/language/flow.md", True),
        ("docs/reference/codes.md", False),
        ("docs/robots/puppet.md", False),
        ("urc/config/codes.md", True),
        ("urc/web/app.py", True),
        ("tests/unit/test_dev.py", False),
        ("dev", True),
        ("LICENSE", False),
        ("schemas/driver.schema.json", True),
        ("package.json", False),
        ("widgets/bar/widget.js", True),
        ("robots/puppet.yaml", True),
        ("tests/broken/dial.yaml", False),
    ],
)
def test_which_files_have_prose(path: str, is_prose: bool) -> None:
    """Generated pages, tests and settings of tools are left out."""
    assert is_read(path) is is_prose


def test_markdown_is_split_into_sentences() -> None:
    """Code blocks are left out; links keep their words; each cell and item is on its own."""
    text = (
        "# A title\n\nOne sentence. Another,\nover two lines.\nA [third](x.md).\n\n"
        "```yaml\nkey: value. No prose\n```\n- item `a.b` ends.\n"
        "| cell one | cell two |\n|---|---|\n"
    )
    assert found("docs/x.md", text) == [
        (1, "docs", "A title"),
        (3, "docs", "One sentence."),
        (3, "docs", "Another, over two lines."),
        (5, "docs", "A third."),
        (10, "docs", "item `a.b` ends."),
        (11, "docs", "cell one"),
        (11, "docs", "cell two"),
    ]


def test_python_has_docstrings_and_strings_for_people() -> None:
    """Keys, labels, patterns and code that is written as text are no prose."""
    text = (
        '"""Says one thing.\n\n    an example\n\nAnother.\n"""\n\n'
        'x: int\n"""Of an attribute."""\n'
        'raise E(f"no robot is called {name}")\nk = "a key"\nr = "def f(x): return (x + 1)"\n'
    )
    assert sorted(found("urc/x.py", text)) == [
        (1, "docstring", "Says one thing."),
        (5, "docstring", "Another."),
        (9, "docstring", "Of an attribute."),
        (10, "string", "no robot is called {}"),
    ]


def test_each_entry_of_a_docstring_is_on_its_own() -> None:
    """A list of arguments has no ends of sentences; SQL has no sentences at all."""
    text = (
        'def f():\n    """Do it.\n\n    Args:\n        a: the first\n            one.\n'
        '        b: another.\n\n    Raises:\n        UrcError: it cannot.\n    """\n'
        'q = "SELECT this FROM that table"\n'
    )
    assert found("urc/x.py", text) == [
        (2, "docstring", "Do it."),
        (4, "docstring", "Args:"),
        (5, "docstring", "a: the first one."),
        (7, "docstring", "b: another."),
        (9, "docstring", "Raises:"),
        (10, "docstring", "UrcError: it cannot."),
    ]


def test_schemas_documents_and_pages_have_strings() -> None:
    """Only values of keys for people, and what is marked for translation."""
    schema = '{\n"description": "Says \\"so\\". Twice.", "pattern": "a. B"}'
    assert found("schemas/x.json", schema) == [
        (2, "string", 'Says "so".'),
        (2, "string", "Twice."),
    ]
    assert found("robots/x.yaml", "name: x\nsignals:\n  a: { title: A title }\n") == [
        (3, "string", "A title")
    ]
    assert found("templates/x.j2", '<p>\n{{ t("Reset it.") }} text(1)') == [
        (2, "string", "Reset it.")
    ]


def test_the_seed_decides_the_draw() -> None:
    """The same commit gives the same sentences; copies and labels are drawn once, or not at all."""
    text = "".join(f"Sentence number {number} stands here.\n" for number in range(100))
    known = candidates({"docs/a.md": text + "Three words only.\n", "docs/b.md": text})
    assert len(known) == 100
    assert draw(known, "abc", 60) == draw(known, "abc", 60)
    assert draw(known, "abc", 60) != draw(known, "abd", 60)
    assert len(draw(known, "abc", 60)) == 60
