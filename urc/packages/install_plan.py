"""An install plan: a lock, the new archives and their signatures."""

from collections.abc import Mapping
from typing import NamedTuple

from urc.packages.lock import Lock
from urc.packages.signature import Signature

__all__ = ["InstallPlan"]


class InstallPlan(NamedTuple):
    """A planned installation."""

    lock: Lock
    archives: Mapping[str, bytes]
    """Archives that must be added to the store, by digest."""
    origins: Mapping[str, str]
    """Source of each package, by package name, such as ``drivers/puppet``."""
    signatures: Mapping[str, Signature]
    """Signatures of the signed archives, by digest of the archive."""
    own: frozenset[str] = frozenset()
    """Packages from a folder that the user named. The pinned keys of these packages are not
    checked.
    """
    waived: frozenset[str] = frozenset()
    """Packages that the user accepts without a signature in this installation."""
    remarks: Mapping[str, str] = {}
    """The repositories' remarks about withdrawals and origins, by digest."""

    @property
    def told(self) -> list[str]:
        """Audit log lines: the requested package, and each package accepted without a signature."""
        return [
            str(self.lock),
            *(
                f"{name} {pin.version} without a signature"
                for name, pin in self.lock.packages.items()
                if name in self.waived and pin.sha256 not in self.signatures
            ),
        ]
