"""A package's lock: versions and digests of the package and its dependencies."""

from collections.abc import Mapping
from typing import Annotated, Final

import msgspec

from urc.packages.archive import PACKAGE
from urc.packages.index import IndexEntry
from urc.packages.names import PackageError, PackageId, parse_key
from urc.packages.package import sha256
from urc.packages.versions import Version, parse_version

__all__ = ["LOCK", "Lock", "Pin", "lock_of", "read_lock"]

LOCK: Final = "urc.lock"
_PACKAGES_MOST: Final = 128


class Pin(msgspec.Struct, frozen=True):
    """The version of one package in a lock, with the digest and the size of its archive."""

    version: Annotated[str, msgspec.Meta(max_length=64)]
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
    size: Annotated[int, msgspec.Meta(ge=0, le=PACKAGE.archive_bytes)]


class Lock(msgspec.Struct, frozen=True):
    """A package and all its dependencies, each in exactly one version."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    root: str
    """Requested package, such as ``drivers/puppet``."""
    packages: dict[str, Pin]
    """Versions by package, including `root`; the keys are names such as ``drivers/puppet``."""

    def __post_init__(self) -> None:
        """Reject a lock with invalid package names or versions."""
        if len(self.packages) > _PACKAGES_MOST or self.root not in self.packages:
            raise ValueError(f"expected 1 to {_PACKAGES_MOST} packages, including the root")
        for key, pin in self.packages.items():
            parse_key(key)
            parse_version(pin.version)

    @property
    def key(self) -> PackageId:
        """Requested package."""
        return parse_key(self.root)

    @property
    def version(self) -> str:
        """Version of the root package."""
        return self.packages[self.root].version

    @property
    def number(self) -> Version:
        """Comparable version of the root package."""
        return parse_version(self.version)

    @property
    def digest(self) -> str:
        """Digest of the lock file, which identifies this combination of versions."""
        return sha256(self.to_bytes())

    def to_bytes(self) -> bytes:
        """Return the lock file's content; equal locks have identical bytes."""
        return msgspec.json.format(msgspec.json.encode(self, order="sorted"), indent=1) + b"\n"

    def __str__(self) -> str:
        return f"{self.root} {self.version}"


def lock_of(root: PackageId, chosen: Mapping[PackageId, IndexEntry]) -> Lock:
    """Return the lock for the versions that the resolver has chosen."""
    pins = {
        str(key): Pin(entry.version, entry.sha256, entry.size)
        for key, entry in sorted(chosen.items())
    }
    return Lock(1, str(root), pins)


def read_lock(data: bytes, where: str) -> Lock:
    """Return the lock in a file; raise `PackageError` on failure."""
    try:
        return msgspec.json.decode(data, type=Lock)
    except (msgspec.DecodeError, PackageError, RecursionError, UnicodeDecodeError) as error:
        raise PackageError(f"{where}: this is not a lock file: {error}") from None
