"""Passphrases: the rules for new ones, their argon2id hashes, and the check of a sign-in.

Layer 4. Slow on purpose: a hash takes about 50 ms and 64 MiB. Servers therefore make one
hash at a time, in a thread. RFC 9106 (argon2id, the second recommended choice of
parameters); NIST SP 800-63B-4 for the rules: length counts, common passwords are refused, and no
composition rules.
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
"""Fewest characters."""
LONGEST: Final = 256
"""Most characters; the hash of a longer text would cost an attacker nothing and the server time."""
WRONG: Final = "the name or the passphrase is wrong"
_FEWEST_DIFFERENT: Final = 4
_JUDGED: Final = 16
"""Characters that the estimate of guesses reads; 16 take at most 0.1 s."""
_FEWEST_POINTS: Final = 2
"""Fewest points of the estimate; 2 of 4 means more than a million guesses."""
_OWN_WORDS: Final = ("urc", "robot", "robots", "controller")
_HASHER: Final = argon2.PasswordHasher()
_NEVER: Final = (
    "$argon2id$v=19$m=65536,t=3,p=4$"
    "Y9S+Qk9ql1FsY7cIblZ4kg$+SK2RqF890o7afnBg00/BKpDnvcql9WqfC07seo0hAU"
)
"""Compared for unknown names, so that the time of the answer does not tell which names exist.
A literal, because computing the hash would take 50 ms of each start of a server."""


def hash_of(passphrase: str, *, name: str = "") -> str:
    """Return the hash of a new passphrase, with its salt and parameters.

    Raises:
        AccessError: the passphrase is too short, too long or too uniform, is the name, or is easy
            to guess, such as a common password.
    """
    passphrase = _normal(passphrase)
    length = len(passphrase)
    if length < SHORTEST:
        raise AccessError(f"the passphrase has {length} characters; at least {SHORTEST} are needed")
    if length > LONGEST:
        raise AccessError(f"the passphrase has {length} characters; at most {LONGEST} are allowed")
    if not passphrase.isprintable():
        raise AccessError("the passphrase has characters that cannot be shown")
    if len(set(passphrase)) < _FEWEST_DIFFERENT:
        raise AccessError(f"the passphrase needs {_FEWEST_DIFFERENT} different characters")
    if name and passphrase.casefold() == name.casefold():
        raise AccessError("the passphrase is the name; choose several words")
    if _is_common(passphrase, name):
        raise AccessError("the passphrase is easy to guess; choose several words")
    return _HASHER.hash(passphrase)


def matches(passphrase: str, kept: str | None) -> bool:
    """Return whether `passphrase` belongs to the hash; always takes the time of one hash.

    Args:
        passphrase: text of the person who signs in.
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
    """Return whether the hash has older parameters and should be replaced at the next sign-in."""
    return _HASHER.check_needs_rehash(kept)


def person_by_passphrase(store: AccessStore, name: str, passphrase: str) -> str:
    """Return the id of the person with this name and passphrase; "" if one of them is wrong.

    The answer takes equally long for an unknown name and for a wrong passphrase. A hash with older
    parameters is replaced. The call blocks for about 50 ms.

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
    """Return whether a million guesses of a program find the passphrase.

    Only its beginning counts, because the estimate of a long text can take seconds.
    """
    from zxcvbn import zxcvbn  # a megabyte of word lists, loaded only for new passphrases

    known = [*_OWN_WORDS, *name.split()]
    score: int = zxcvbn(passphrase[:_JUDGED], user_inputs=known)["score"]
    return score < _FEWEST_POINTS


def _normal(passphrase: str) -> str:
    """Return the one form of texts that look equal; keyboards write “é” in two ways (NFKC)."""
    return unicodedata.normalize("NFKC", passphrase)
