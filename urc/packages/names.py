"""Package names: a kind and a name, such as ``drivers/puppet``, with an optional version."""

import re
from typing import Final, NamedTuple

from urc.problems import UrcError

__all__ = [
    "FOLDERS",
    "KINDS",
    "NAME",
    "PackageId",
    "PackageError",
    "PackageRequirement",
    "parse_key",
    "parse_requirement",
]

KINDS: Final = ("driver", "interface", "widget", "robot")
FOLDERS: Final = {f"{kind}s": kind for kind in KINDS}
"""Kind of package in each folder, by folder name."""
NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,63}")


class PackageError(UrcError):
    """Raised if an operation on packages or repositories fails; the message is one line."""


class PackageId(NamedTuple):
    """The identity of a package, without its version."""

    kind: str
    """One of `KINDS`."""
    name: str

    def __str__(self) -> str:
        return f"{self.kind}s/{self.name}"


class PackageRequirement(NamedTuple):
    """A package name with an optional kind and version range, as typed by the user."""

    kind: str
    """The package's kind; "" for any kind."""
    name: str
    range: str = "*"

    def __str__(self) -> str:
        text = f"{self.kind}s/{self.name}" if self.kind else self.name
        return text if self.range == "*" else f"{text}@{self.range}"


def parse_key(text: str) -> PackageId:
    """Return the identity in text such as ``drivers/puppet``; raise `PackageError` if invalid."""
    folder, slash, name = text.partition("/")
    if not slash or folder not in FOLDERS or not NAME.fullmatch(name):
        raise PackageError(
            f"{text!r} is not a package name: write drivers/NAME, interfaces/NAME, widgets/NAME"
            " or robots/NAME, with lower-case letters, digits and '-'"
        )
    return PackageId(FOLDERS[folder], name)


def parse_requirement(text: str) -> PackageRequirement:
    """Parse ``puppet``, ``drivers/puppet`` or ``puppet@^1.2``; raise `PackageError` if invalid."""
    package, at, wanted = text.partition("@")
    if "/" in package:
        key = parse_key(package)
        kind, name = key.kind, key.name
    elif NAME.fullmatch(package):
        kind, name = "", package
    else:
        raise PackageError(
            f"{text!r} is not a package name;"
            " expected NAME or drivers/NAME, with @VERSION for a version"
        )
    if at and not wanted:
        raise PackageError(f"{text!r}: expected a version after '@'")
    return PackageRequirement(kind, name, wanted or "*")
