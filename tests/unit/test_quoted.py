"""How values stand in messages to people: as a robot's sheet writes them, never as Python does."""

import pytest

from urc.expressions import quoted, spelt


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "“not available”"),
        (True, "true"),
        (20.0, "20"),
        (1e39, "1e+39"),
        (float("nan"), "nan"),
        ("warm", "'warm'"),
        ("it's", '"it\'s"'),
        ("a\\b\n\x1b[2J\u202e", "'a\\b\\n\\x1b[2J\\u202e'"),
        (b"\x00\xff", "hex 00 ff"),
        ((1, 2.0, None, True), "[1, 2, null, true]"),
        ({"x": 1.5, "at": ("a", None)}, '{"x": 1.5, "at": ["a", null]}'),
        ("x" * 50, f"'{'x' * 37}...'"),
        (tuple(range(50)), "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11..."),
    ],
)
def test_a_value_is_written_as_people_write_it(value: object, text: str) -> None:
    """Each escape once, and nothing of any length."""
    assert quoted(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [((1, 2.0, "a"), '[1, 2, "a"]'), ({"x": None}, '{"x": null}'), ((), "[]"), ({}, "{}")],
)
def test_a_list_in_a_text_is_a_list_as_json_has_it(value: object, text: str) -> None:
    """In what is sent and in what is told."""
    assert spelt(value) == text
