"""The check of a person's name and passphrase.

Layer 4. The answer takes equally long for unknown names and for wrong passphrases.
"""

from typing import Final

from urc.access.grants import AccessError
from urc.access.passphrases import hash_of, is_stale, matches
from urc.access.store import AccessStore

__all__ = ["WRONG", "person_by_passphrase"]

WRONG: Final = "the name or the passphrase is wrong"


def person_by_passphrase(store: AccessStore, name: str, passphrase: str) -> str:
    """Return the id of the person with this name and passphrase; "" if one of them is wrong.

    A hash with older parameters is replaced. The call blocks for about 50 ms.

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
