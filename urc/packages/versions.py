"""Versions according to Semantic Versioning 2.0 and version ranges of dependencies.

`semver` parses and compares versions. The library does not support ranges, so URC parses them:
``^1.2``, ``~1.2.3``, ``>=1.2, <2``, ``1.2.3`` and ``*``.
"""

import re
from functools import cached_property, lru_cache
from typing import NamedTuple

from semver import Version

from urc.packages.names import PackageError

__all__ = ["Range", "Version", "parse_range", "parse_version"]

_LONGEST = 64
_PART = re.compile(
    r"(?P<sign>\^|~|>=|<=|>|<|=)?\s*(?P<major>0|[1-9]\d{0,8})"
    r"(?:\.(?P<minor>0|[1-9]\d{0,8})(?:\.(?P<patch>0|[1-9]\d{0,8})"
    r"(?:-(?P<pre>[0-9A-Za-z-]+(?:\.[0-9A-Za-z-]+)*))?)?)?",
    re.ASCII,
)


@lru_cache(maxsize=65536)
def parse_version(text: str) -> Version:
    """Parse `text` as a version; raise `PackageError` if it is invalid or contains build metadata.

    With build metadata, two equal versions could have different bytes.
    """
    try:
        if len(text) > _LONGEST or not text.isascii() or not text.isprintable():
            raise ValueError
        version = Version.parse(text)
    except ValueError:
        raise PackageError(
            f"{text[:_LONGEST]!r} is not a version; expected MAJOR.MINOR.PATCH, such as 1.2.0"
        ) from None
    if version.build:
        raise PackageError(f"{text!r}: the version of a package cannot have build metadata ('+…')")
    return version


class _Bound(NamedTuple):
    sign: str
    """Comparison operator: ``>=``, ``>``, ``<`` or ``<=``."""
    version: Version

    def allows(self, version: Version) -> bool:
        match self.sign:
            case ">=":
                return bool(version >= self.version)
            case ">":
                return bool(version > self.version)
            case "<":
                return bool(version < self.version)
            case _:
                return bool(version <= self.version)


class Range:
    """A range of versions, such as ``^1.2`` or ``>=1.2, <2``."""

    def __init__(self, text: str, bounds: tuple[_Bound, ...]) -> None:
        self.text = text
        self._bounds = bounds

    def __str__(self) -> str:
        return self.text

    def allows(self, version: Version) -> bool:
        """Return whether a version is in the range.

        A pre-release matches only if the range names a pre-release of the same x.y.z. Users
        therefore receive pre-releases only on request.
        """
        if version.prerelease and _core(version) not in self._unfinished:
            return False
        return self.spans(version)

    def spans(self, version: Version) -> bool:
        """Return whether a version is within the range's bounds, even as a pre-release."""
        return all(bound.allows(version) for bound in self._bounds)

    @cached_property
    def _unfinished(self) -> frozenset[tuple[int, int, int]]:
        return frozenset(
            _core(bound.version)
            for bound in self._bounds
            if bound.version.prerelease and bound.version.prerelease != "0"
        )


def _core(version: Version) -> tuple[int, int, int]:
    return version.major, version.minor, version.patch


@lru_cache(maxsize=4096)
def parse_range(text: str) -> Range:
    """Parse a range of comma-separated parts; raise `PackageError` if it is invalid.

    A version must match all parts of the range.
    """
    if text.strip() == "*":
        return Range("*", ())
    bounds: list[_Bound] = []
    for part in text.split(","):
        found = _PART.fullmatch(part.strip()) if len(text) <= 2 * _LONGEST else None
        if found is None:
            raise PackageError(
                f"{text[: 2 * _LONGEST]!r} is not a range of versions;"
                " expected ^1.2, ~1.2.3, '>=1.2, <2', 1.2.3 or *"
            )
        bounds += _bounds(found)
    return Range(text.strip(), tuple(bounds))


def _bounds(found: re.Match[str]) -> list[_Bound]:
    """Return the bounds of one part of a range; an omitted number matches any number."""
    sign = found["sign"] or "="
    major, minor, patch = (
        None if found[name] is None else int(found[name]) for name in ("major", "minor", "patch")
    )
    assert major is not None  # noqa: S101 (every match of the pattern has it)
    low = Version(major, minor or 0, patch or 0, found["pre"])
    match sign:
        case ">=" | "<":
            return [_Bound(sign, low)]
        case ">":
            return [_Bound(">", low)] if patch is not None else [_Bound(">=", _after(low, minor))]
        case "<=":
            return [_Bound("<=", low)] if patch is not None else [_Bound("<", _after(low, minor))]
        case "=" if patch is not None:
            return [_Bound(">=", low), _Bound("<=", low)]
        case "^":
            return [_Bound(">=", low), _Bound("<", _caret(major, minor, patch))]
        case _:
            return [_Bound(">=", low), _Bound("<", _after(low, minor))]


def _after(low: Version, minor: int | None) -> Version:
    """Return the first version above all versions that match `1` or `1.2`."""
    if minor is None:
        return Version(low.major + 1, 0, 0, "0")
    return Version(low.major, low.minor + 1, 0, "0")


def _caret(major: int, minor: int | None, patch: int | None) -> Version:
    """Return the first incompatible version, in which the leftmost nonzero number is increased."""
    if major or minor is None:
        return Version(major + 1, 0, 0, "0")
    if minor or patch is None:
        return Version(0, minor + 1, 0, "0")
    return Version(0, 0, patch + 1, "0")
