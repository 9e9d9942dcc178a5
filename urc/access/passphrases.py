"""Passphrases: rules for new passphrases, argon2id hashes, and the check at sign-in.

Layer 4. Hashing is deliberately slow: each hash takes about 50 ms and 64 MiB of memory. Servers
therefore compute one hash at a time, in a thread. The hashes follow RFC 9106 (argon2id, with the
second recommended set of parameters). The rules follow NIST SP 800-63B-4: a minimum length, no
common passwords, and no composition rules.
"""

import unicodedata
from typing import Final

import argon2

from urc.access.grants import AccessError
from urc.access.store import AccessStore

__all__ = [
    "LONGEST",
    "SHORTEST",
    "WRONG",
    "hash_of",
    "is_stale",
    "matches",
    "person_by_passphrase",
]

SHORTEST: Final = 8
"""Minimum number of characters in a passphrase."""
LONGEST: Final = 256
"""Maximum number of characters; longer text would let attackers waste the server's time."""
WRONG: Final = "the name or the passphrase is wrong"
_FEWEST_DIFFERENT: Final = 4
_JUDGED: Final = 16
"""Number of first characters that zxcvbn rates; rating 16 characters takes at most 0.1 s."""
_FEWEST_POINTS: Final = 2
"""Minimum score from zxcvbn, 0 to 4; a score of 2 means more than a million guesses."""
_OWN_WORDS: Final = ("urc", "robot", "robots", "controller")
_HASHER: Final = argon2.PasswordHasher()
_NEVER: Final = (
    "$argon2id$v=19$m=65536,t=3,p=4$"
    "Y9S+Qk9ql1FsY7cIblZ4kg$+SK2RqF890o7afnBg00/BKpDnvcql9WqfC07seo0hAU"
)
"""Hash checked for unknown names, so that the response time does not reveal which names exist.
The hash is a literal, because computing it would delay each server start by 50 ms."""


def hash_of(passphrase: str, *, name: str = "") -> str:
    """Return a new passphrase's hash, with its salt and parameters.

    Raises:
        AccessError: the passphrase is too short, too long, unprintable, too uniform, identical to
            the name, or easy to guess, such as a common password.
    """
    passphrase = _normal(passphrase)
    length = len(passphrase)
    if length < SHORTEST:
        raise AccessError(f"the passphrase has {length} characters; at least {SHORTEST} are needed")
    if length > LONGEST:
        raise AccessError(f"the passphrase has {length} characters; at most {LONGEST} are allowed")
    if not passphrase.isprintable():
        raise AccessError("the passphrase contains unprintable characters")
    if len(set(passphrase)) < _FEWEST_DIFFERENT:
        raise AccessError(f"the passphrase needs at least {_FEWEST_DIFFERENT} different characters")
    if name and passphrase.casefold() == name.casefold():
        raise AccessError("the passphrase is the name; choose several words")
    if _is_common(passphrase, name):
        raise AccessError("the passphrase is easy to guess; choose several words")
    return _HASHER.hash(passphrase)


def matches(passphrase: str, kept: str | None) -> bool:
    """Return whether `passphrase` matches the hash.

    The check takes equally long for known and unknown people, so its time reveals no names.

    Args:
        passphrase: passphrase entered at the sign-in.
        kept: the result of `hash_of`; None for an unknown person.
    """
    if len(passphrase) > LONGEST:
        return False
    try:
        _HASHER.verify(kept or _NEVER, _normal(passphrase))
    except (
        argon2.exceptions.VerificationError,
        argon2.exceptions.InvalidHashError,
        UnicodeEncodeError,
    ):
        return False
    return kept is not None


def is_stale(kept: str) -> bool:
    """Return whether the hash has outdated parameters and should be replaced."""
    return _HASHER.check_needs_rehash(kept)


def person_by_passphrase(store: AccessStore, name: str, passphrase: str) -> str:
    """Return the id of the person with this name and passphrase; "" if either is wrong.

    The check takes the same time for an unknown name as for a wrong passphrase. A hash with
    outdated parameters is replaced. The call blocks for about 50 ms.

    Raises:
        AccessError: the store cannot be used.
    """
    person, kept = store.passphrase_of(" ".join(name.split()))
    if not matches(passphrase, kept) or kept is None:
        return ""
    if is_stale(kept):
        try:
            store.set_passphrase(person, hash_of(passphrase))
        except AccessError:
            return person  # stricter rules apply to new passphrases only
    return person


def _is_common(passphrase: str, name: str) -> bool:
    """Return whether a program could find the passphrase with a million guesses.

    Only the beginning of the passphrase is checked, because checking long text can take seconds.
    """
    from zxcvbn import zxcvbn  # one megabyte of word lists, needed only for new passphrases

    known = [*_OWN_WORDS, *name.split()]
    score: int = zxcvbn(passphrase[:_JUDGED], user_inputs=known)["score"]
    return score < _FEWEST_POINTS


def _normal(passphrase: str) -> str:
    """Return the text in NFKC form, because keyboards can encode “é” in two ways."""
    return unicodedata.normalize("NFKC", passphrase)
