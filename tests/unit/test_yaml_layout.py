"""The lines before a YAML error: columns, quotes, commas and colons that are probably meant."""

import pytest

from urc._yaml_layout import (
    column_hint,
    entry_hint,
    item_hint,
    missing_comma,
    open_braces,
    runaway_quote,
)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a:\n  b: 1\n   c: 2", "start this line in column 3, like line 2"),
        ("a:\n    b: 1\n   c: 2", "start this line in column 5, like line 2"),
        ("a:\n    b: 1\n  c: 2", "start this line in column 5, like line 2"),
        ("a:\n  b:\n    c: 1\n d: 2", "start this line in column 1, like line 1"),
        ("a:\n  - b: 1\n   c: 2", "start this line in column 5, like line 2"),
        ("a:\n  - b: 1\n\n  # no entry\n   - c: 2", "start this line in column 5, like line 2"),
        ("a:\n  b: 1\n  c: 2", ""),
        ("a: 1", ""),
    ],
)
def test_a_line_belongs_to_the_nearest_block(text: str, hint: str) -> None:
    """The block of the line above, if two are as near."""
    lines = text.split("\n")
    assert column_hint(lines, len(lines) - 1) == hint


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("type:tcp", "put a space after the colon: 'type: tcp'"),
        ("type tcp", "put a colon after the key: 'type: tcp'"),
        ("type = tcp", "put a colon after the key: 'type: tcp'"),
        ("signals", "put a colon after the key: 'signals:'"),
        ("http://robot", "write 'key: value', with a space after the colon"),
        ("A cart on a bench", "write 'key: value', with a space after the colon"),
    ],
)
def test_a_line_without_a_colon_is_completed(text: str, hint: str) -> None:
    assert entry_hint(text) == hint


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("  -every: 1s", "put a space after the dash: '- every: 1s'"),
        ("  - every: 1s", ""),
        ("  -1", ""),
        (f"-a: {'x' * 1000}", ""),
    ],
)
def test_a_dash_without_a_space_is_found(text: str, hint: str) -> None:
    assert item_hint(text) == hint


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('a: "b\nc: "d', (0, 3, '"')),
        ("a: 'b\nx: 1\nc: 'd", (0, 3, "'")),
        ('a: { b: "c }\nd: "e', (0, 8, '"')),
        ('a: "b"\nc: "d', None),
        ('a: "b\\""\nc: "d', None),
        ("a: operator's\nc: 'd", None),
        ('a: "b\nx: "y"\nc: "d', None),
        ("a: b\nc: d", None),
    ],
)
def test_a_text_that_ends_in_another_line_is_found(
    text: str, found: tuple[int, int, str] | None
) -> None:
    lines = text.split("\n")
    assert runaway_quote(lines, len(lines) - 1, len(lines[-1])) == found


@pytest.mark.parametrize(
    ("text", "column", "found"),
    [
        ("{ use: battery bind: { level: x } }", 19, 15),
        ('{ host: "a" port: 1 }', 12, 12),
        ("{ use: battery, bind: x }", 20, None),
        ("{ use: battery }", 15, None),
    ],
)
def test_a_missing_comma_is_found(text: str, column: int, found: int | None) -> None:
    assert missing_comma(text, column) == found


@pytest.mark.parametrize(
    ("text", "is_open"),
    [
        ("a: { b: { c: 1 }", True),
        ("a: [1, 2", True),
        ('a: { b: "}"', True),
        ('a: { b: "{{ c }}" }', False),
        ("a: { b: { c: 1", False),
    ],
)
def test_a_line_that_lacks_one_brace_is_found(text: str, is_open: bool) -> None:
    assert open_braces(text) is is_open
