"""Passphrases: rules and hashes."""

import time

import argon2
import pytest

from urc.access import passphrases
from urc.access.grants import AccessError
from urc.access.passphrases import _NEVER, hash_of, is_stale, matches

GOOD = "correct horse battery"


@pytest.fixture(autouse=True)
def hash_at_the_full_price(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a server does; the other unit tests hash quickly."""
    monkeypatch.setattr(passphrases, "_HASHER", argon2.PasswordHasher())
    monkeypatch.setattr(passphrases, "_NEVER", _NEVER)


def test_a_passphrase_matches_its_hash_alone() -> None:
    kept = hash_of(GOOD)
    assert kept.startswith("$argon2id$")
    assert GOOD not in kept
    assert matches(GOOD, kept)
    assert not matches(GOOD + " ", kept)
    assert not matches("x" * 300, kept)
    assert not matches(GOOD, None), "an unknown person"
    assert not matches(GOOD, "no hash")
    assert hash_of(GOOD) != kept, "each has a salt"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("short", "the passphrase has 5 characters; at least 8 are needed"),
        ("x1" * 129, "the passphrase has 258 characters; at most 256 are allowed"),
        ("aaabbbaaabbb", "the passphrase needs at least 4 different characters"),
        ("Margarethe", "the passphrase is the name; choose several words"),
        ("Margarethe1", "the passphrase is easy to guess; choose several words"),
        ("password1", "the passphrase is easy to guess; choose several words"),
        ("P@ssw0rd!", "the passphrase is easy to guess; choose several words"),
        ("robot123", "the passphrase is easy to guess; choose several words"),
        ("qwertzuiop", "the passphrase is easy to guess; choose several words"),
        ("password" * 8, "the passphrase is easy to guess; choose several words"),
    ],
)
def test_a_weak_passphrase_is_refused(text: str, message: str) -> None:
    with pytest.raises(AccessError) as caught:
        hash_of(text, name="margarethe")
    assert str(caught.value) == message


def test_a_hash_with_older_parameters_is_due_for_another() -> None:
    """RFC 9106, appendix: the hash of another program, with small parameters."""
    old = "$argon2id$v=19$m=256,t=2,p=1$c29tZXNhbHQ$nf65EOgLrQMR/uIPnA4rEsF5h7TKyQwu9U1bMCHGi/4"
    assert matches("password", old)
    assert is_stale(old)
    assert not is_stale(hash_of(GOOD))


def test_the_hash_for_unknown_names_costs_what_a_new_hash_costs() -> None:
    assert not is_stale(_NEVER)


def test_two_forms_of_the_same_letters_are_one_passphrase() -> None:
    composed, decomposed = "caf\u00e9 au lait", "cafe\u0301 au lait"
    kept = hash_of(decomposed)
    assert matches(composed, kept)
    assert matches(decomposed, kept)
    assert not matches("cafe au lait", kept)


def test_broken_text_is_refused_without_an_exception() -> None:
    with pytest.raises(AccessError, match="unprintable characters"):
        hash_of("long enough \udcff")
    assert not matches("long enough \udcff", hash_of("long enough"))


def test_a_hostile_text_is_judged_in_a_short_time() -> None:
    """The estimate of 72 such characters takes eight seconds."""
    began = time.process_time()
    hash_of("4@8({[</369&#!1i|0$5+7%2/" * 10, name="4@8 " * 16)
    assert time.process_time() - began < 2
