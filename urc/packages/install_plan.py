"""An install plan: a lock, with new archives and their signatures."""

from collections.abc import Mapping
from typing import NamedTuple

from urc.packages.lock import Lock
from urc.packages.signature import Signature

__all__ = ["InstallPlan"]


class InstallPlan(NamedTuple):
    """An installation that is not executed yet."""

    lock: Lock
    archives: Mapping[str, bytes]
    """Digest → bytes, for archives that the store lacks."""
    origins: Mapping[str, str]
    """``drivers/puppet`` → its source."""
    signatures: Mapping[str, Signature]
    """Digest → signature, for signed archives."""
    own: frozenset[str] = frozenset()
    """Packages from a folder that the user named. These packages are accepted without a check of
    the pinned key.
    """
    remarks: Mapping[str, str] = {}
    """Digest → remark of its repository, about a withdrawal or the origin."""
