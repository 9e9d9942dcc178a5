"""What packages are called: a kind and a name, as ``drivers/puppet``, and perhaps a version."""

import re
from typing import Final, NamedTuple

from urc.problems import UrcError

__all__ = ["FOLDERS", "KINDS", "NAME", "Key", "PackageError", "Wish", "parse_key", "parse_wish"]

KINDS: Final = ("driver", "interface", "widget", "robot")
FOLDERS: Final = {f"{kind}s": kind for kind in KINDS}
"""Folder of a kind → kind: packages of one kind stand in one folder, everywhere."""
NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,63}")


class PackageError(UrcError):
    """What cannot be done with a package, a repository or the store, in one line."""


class Key(NamedTuple):
    """What tells packages apart, whatever their version."""

    kind: str
    """One of `KINDS`."""
    name: str

    def __str__(self) -> str:
        return f"{self.kind}s/{self.name}"


class Wish(NamedTuple):
    """What somebody asks for on a command line."""

    kind: str
    """"" for whichever has the name."""
    name: str
    range: str = "*"

    def __str__(self) -> str:
        text = f"{self.kind}s/{self.name}" if self.kind else self.name
        return text if self.range == "*" else f"{text}@{self.range}"


def parse_key(text: str) -> Key:
    """Return the package that ``drivers/puppet`` names; raise `PackageError`."""
    folder, slash, name = text.partition("/")
    if not slash or folder not in FOLDERS or not NAME.fullmatch(name):
        raise PackageError(
            f"{text!r} names no package: write drivers/NAME, interfaces/NAME, widgets/NAME"
            " or robots/NAME, in small letters, digits and '-'"
        )
    return Key(FOLDERS[folder], name)


def parse_wish(text: str) -> Wish:
    """Return what ``puppet``, ``drivers/puppet`` or ``puppet@^1.2`` asks for."""
    package, at, wanted = text.partition("@")
    if "/" in package:
        key = parse_key(package)
        kind, name = key.kind, key.name
    elif NAME.fullmatch(package):
        kind, name = "", package
    else:
        raise PackageError(
            f"{text!r} names no package: write NAME or drivers/NAME, and @VERSION for a version"
        )
    if at and not wanted:
        raise PackageError(f"{text!r}: a version is expected after '@'")
    return Wish(kind, name, wanted or "*")
