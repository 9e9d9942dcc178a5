"""Patterns that make other engines hang: here each is matched in linear time, or refused.

The limits are absolute, and far from both sides: a linear match of these texts takes milliseconds,
a quadratic one minutes, and an exponential one for ever.
"""

import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.patterns import Pattern, PatternError, compile_pattern

LIMIT_S = 2.0
LONG = 100_000
WORST = (
    r"^(a+)+$", r"(a+)+$", r"^(a|a)*$", r"^(a|aa)+$", r"^(.*a){20}$", r"^(\w+\s?)*$",
    r"^([a-zA-Z0-9])(([\-.]|[_]+)?([a-zA-Z0-9]+))*@[a-z0-9]+[.]([a-z]{2,3}|[a-z]{2,3}[.][a-z]{2})$",
    r"^(([a-z])+.)+[A-Z]([a-z])+$", r"^\s+|\s+$", r"\s+$", r"^(\d+)*$", r"^(?:(?:a*)*)*$",
    r"^(a?){30}a{30}$", r"^.*.*=.*$", r"x*y*z*x*y*z*w", r"^(([^\"]|\"\")*)\"$",
    r"(\"([^\"\\]|\\.)*\")*", r"^(?P<n>-?\d*\.?\d*)*$", r"^(a*)*b", r"(.*)(.*)(.*)(.*)(.*)x",
    r"[^x]*x[^x]*x[^x]*x$", r"^a*a*a*a*a*a*b$", r"^(a|b|ab)*c", r"(?i)^(k+)+$", r"^(?:.|\n)*x$",
    r"^(\s|\S)*x$", r"^([\s\S]+)+x", r"^.*?.*?.*?x", r"^(\d|\w)+x", r"^[0-9]*[0-9]*x",
    r"^(?P<a>\S*) ?(?P<b>\S*) ?x", r"^(a*?)*?b", r"^\w*\d*\w*x", r"^(é+)+$", r"^[é-ü]*[é]*x",
    r"^[^b]*[^a]*x", r"^((?:[0-9]{1,3}\.){3}[0-9]{1,3},?)+x", r"^(a{2}|a{3})*b",
    r"^(?:a{1,3}){60}b$", r"^[a-z]{1,90}[a-z]{1,90}x$", r"^(?:a|b)*?c", r"^(a+|b+)*c$",
)  # fmt: skip
REPEATED = ("a", "ab", "1", "a ", "a.", " ", '"', "x", "é", "0,", "b", "aA", '\\"', "a\n")


def seconds(pattern: Pattern, text: str) -> float:
    begin = time.process_time()
    pattern.search(text)
    return time.process_time() - begin


@pytest.mark.parametrize("source", WORST)
def test_a_pattern_that_makes_others_hang_is_matched_at_once(source: str) -> None:
    """On the text that almost fits, a hundred thousand characters long."""
    pattern = compile_pattern(source)
    for part in REPEATED:
        assert seconds(pattern, part * (LONG // len(part)) + "!") < LIMIT_S, part


@pytest.mark.parametrize(
    "source",
    [
        r"^(a{1,1000}){1,1000}$",
        r"^((a{0,100}){0,100}){0,100}$",
        r"^(?:a{1,3}){300}b$",
        r"^[a-z]{1,900}[a-z]{1,900}x$",
        r"(\w+)\1",
        r"^(?=a+)a",
    ],
)
def test_what_would_need_too_much_is_refused(source: str) -> None:
    """Repeats that multiply, and what no automaton can do."""
    with pytest.raises(PatternError):
        compile_pattern(source)


ATOMS = st.sampled_from(
    ["a", "b", "[ab]", "[^a]", ".", r"\d", r"\w", r"\s", r"\S", r"\W", ",", "1", "[a-c]", "é"]
)
PIECES = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map("".join),
        inner.map(lambda one: f"({one})"),
        st.tuples(inner, inner).map(lambda two: f"(?:{two[0]}|{two[1]})"),
        st.tuples(inner, st.sampled_from(["*", "+", "?", "*?", "{2}", "{1,3}", "{0,50}"])).map(
            lambda two: f"(?:{two[0]}){two[1]}"
        ),
    ),
    max_leaves=8,
)


@settings(max_examples=examples(1200), deadline=None)
@given(PIECES, PIECES, st.sampled_from(["", "$", "x$"]))
def test_no_pattern_of_the_dialect_takes_long(first: str, second: str, end: str) -> None:
    """Whichever engine it runs on: what is proven harmless is harmless."""
    try:
        pattern = compile_pattern(f"^{first}{second}{end}")
    except PatternError:
        return
    for part in ("a", "ab", "1", " ", "é"):
        assert seconds(pattern, part * (20_000 // len(part)) + "!") < LIMIT_S
