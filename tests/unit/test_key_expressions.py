"""Key expressions agree with those of the Zenoh library, and have their price in bounds."""

import random
import time

import pytest
import zenoh

from urc.key_expressions import key_fault, key_matches

CHUNKS = (
    *("a", "b", "ab", "*", "**", "$*a", "a$*", "a$*b", "a$*b$*", "@a", "$*", "a*", "$*$*", ""),
    *("$*b$*", "@a$*", "$a", "a#", "a?", "+", "é"),
)
WORDS = ("a", "b", "ab", "aab", "ba", "@a", "@ab", "abb", "abab", "+", "é")


def is_valid(expression: str) -> bool:
    try:
        zenoh.KeyExpr(expression)
    except zenoh.ZError:
        return False
    return True


def test_validity_and_matches_are_those_of_the_library() -> None:
    """On random expressions and keys, of which half are valid and a tenth match."""
    chance = random.Random(7)  # noqa: S311 - the same in every run
    valid = matched = 0
    for _ in range(20_000):
        expression = "/".join(chance.choices(CHUNKS, k=chance.randint(1, 4)))
        is_ours = key_fault(expression, is_expression=True) == ""
        assert is_ours == is_valid(expression), expression
        if not is_ours:
            continue
        valid += 1
        key = "/".join(chance.choices(WORDS, k=chance.randint(1, 4)))
        fits = key_matches(expression)(key)
        assert fits == zenoh.KeyExpr(expression).includes(key), (expression, key)
        matched += fits
    assert valid > 4000
    assert matched > 400


@pytest.mark.parametrize("key", ["lamp/set", "a", "é/+/b", "@urc/ping", "a b"])
def test_key_without_wildcards_is_a_key(key: str) -> None:
    assert key_fault(key) == ""
    assert is_valid(key)


@pytest.mark.parametrize("key", ["", "/a", "a/", "a//b", "a/*", "**", "a$*", "a?b", "a#", "a\0"])
def test_anything_else_is_told(key: str) -> None:
    """Some of these would be expressions, and reach more than one key."""
    assert key_fault(key)


def test_key_of_64_kib_is_the_longest() -> None:
    assert key_fault("x" * 65_535) == ""
    assert key_fault("x" * 65_536)
    assert key_fault("é" * 40_000)


def test_expression_cannot_cost_much_time() -> None:
    """Many wildcards over a long key, which a search with retries would not finish."""
    expression = "/".join(["**", "a"] * 30)
    began = time.perf_counter()
    assert not key_matches(expression)("/".join(["a"] * 500 + ["b"]))
    assert not key_matches("$*".join(["a"] * 40) + "b")("a" * 5000)
    assert time.perf_counter() - began < 2.0
