"""What would be installed: a lock, the archives that it takes, and who signed them."""

from collections.abc import Mapping
from typing import NamedTuple

from urc.packages.lock import Lock
from urc.packages.signature import Signature

__all__ = ["Plan"]


class Plan(NamedTuple):
    """What would be installed."""

    lock: Lock
    archives: Mapping[str, bytes]
    """Digest → bytes of what the store has not."""
    origins: Mapping[str, str]
    """``drivers/puppet`` → where it comes from."""
    signatures: Mapping[str, Signature]
    """Digest → who made it; of what is not signed nothing."""
    own: frozenset[str] = frozenset()
    """``drivers/puppet``, of what comes from a folder that somebody named: it is taken as it is,
    whoever signed earlier versions."""
    remarks: Mapping[str, str] = {}
    """Digest → what its repository says of it beside: that it is withdrawn, where it was made."""
