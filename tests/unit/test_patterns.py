"""Patterns: which run on `re`, which on RE2, which are refused, and that both agree."""

from contextlib import suppress

import pytest
import re2
from hypothesis import given
from hypothesis import strategies as st

from urc.patterns import PatternError, compile_pattern

PROVEN = [
    r"^(?P<battery>\d+)$",
    r"^BAT (?P<v>[\d.]+) (?P<i>-?\d+)$",
    r"^(?:ON|OFF)$",
    r"^(?P<x>\d+)(\.\d+)?$",
    r"^(?P<a>-?\d+(?:\.\d+)?),(?P<b>[^,]*)$",
    r"^\d{2}:\d{2}$",
    r"^x?y?z$",
    r"^.*$",
    r"^a\$",
    r"^OK",
    r"^\$GP[A-Z]{3},(?P<t>[\d.]*),",
]
NOT_PROVEN = [
    r"^(a+)+$",
    r"(\d+)x",
    r"^(\d+)\s*\d+$",
    r"^(\w+)\d+",
    r"^(?:a|ab)*",
    r"^(x*)?(y*)?$",
    r"^.*,x$",
    r"(?i)^a$",
    r"^(?:a|a)(?:a|a)$",
    r"^a$|b$",
]


@pytest.mark.parametrize("source", PROVEN)
def test_a_pattern_whose_parts_share_no_character_runs_on_re(source: str) -> None:
    """These are the patterns of real robots' lines."""
    assert compile_pattern(source).is_proven


@pytest.mark.parametrize("source", NOT_PROVEN)
def test_a_pattern_that_is_not_proven_runs_on_re2(source: str) -> None:
    """Some of these would take `re` longer than the age of the robot."""
    assert not compile_pattern(source).is_proven


@pytest.mark.parametrize(
    ("source", "offset", "words"),
    [
        ("^(", 1, "invalid pattern"),
        ("a**", 2, "multiple repeat"),
        ("^a(?=b)", 0, "look-ahead"),
        (r"^(a)\1", 0, "back-references"),
        ("^a++", 0, "possessive"),
        ("x{5000}", 0, "at most 1000"),
        ("^[[a]$", 0, "escape the character with a backslash"),
        ("a" * 2000, 0, "at most 1024"),
        ("(" * 800, 0, ""),
    ],
)
def test_what_the_dialect_lacks_is_refused_in_words(source: str, offset: int, words: str) -> None:
    """At load, with a place; never while driving."""
    with pytest.raises(PatternError) as caught:
        compile_pattern(source)
    assert words in str(caught.value)
    assert caught.value.offset >= offset


def test_the_end_of_a_pattern_is_the_very_end() -> None:
    """`re` alone would let a final newline pass."""
    pattern = compile_pattern(r"^(?P<n>\d+)$")
    assert pattern.search("42") == {"n": "42"}
    assert pattern.search("42\n") is None
    assert pattern.search("٤٢") is None


def test_groups_come_in_the_order_of_the_pattern() -> None:
    """Their order is the order of the columns of a reply."""
    assert compile_pattern(r"^(?P<z>\d),(\d),(?P<a>\d)$").groups == ("z", "a")


@given(st.sampled_from(PROVEN), st.text(alphabet="BATONF0123456789.,-: xyz$GP\n", max_size=30))
def test_re_and_re2_give_the_same_answer(source: str, text: str) -> None:
    """A pattern may change the library below it without changing its meaning."""
    expected = re2.search(source, text)
    found = compile_pattern(source).search(text)
    assert found == (None if expected is None else expected.groupdict())


@given(st.text(max_size=60))
def test_any_text_is_a_pattern_or_is_refused_in_words(text: str) -> None:
    """Nothing but PatternError leaves."""
    with suppress(PatternError):
        compile_pattern(text).search("a" * 50)
