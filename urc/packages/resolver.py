"""Dependency resolution, which chooses a version for every required package.

The search uses `resolvelib`, which is pip's resolver. The resolver backtracks after a conflict and
reports conflicts that have no solution. This module defines packages, dependencies and the
preferred version, which is the newest match.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

from resolvelib import AbstractProvider, BaseReporter, ResolutionImpossible, Resolver
from resolvelib.resolvers import ResolutionTooDeep

from urc.packages.index import IndexEntry
from urc.packages.manifest import LANGUAGE
from urc.packages.names import PackageError, PackageId, PackageRequirement, parse_key
from urc.packages.versions import parse_range, parse_version

__all__ = ["choose", "resolve"]

_ROUNDS: Final = 2000
_PACKAGES_MOST: Final = 128


class _Need(NamedTuple):
    key: PackageId
    wanted: str


Entries = Mapping[PackageId, Sequence[IndexEntry]]


def choose(entries: Entries, required: PackageRequirement) -> PackageId:
    """Return the only available package that matches a requirement's kind and name.

    Raises:
        PackageError: no package has this name, or packages of several kinds have this name.
    """
    found = [
        key for key in entries if key.name == required.name and required.kind in ("", key.kind)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(map(str, sorted(found)))
        raise PackageError(f"{required.name!r} is ambiguous; expected one of {names}")
    from difflib import get_close_matches

    near = get_close_matches(required.name, [key.name for key in entries], 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise PackageError(
        f"no repository has {PackageRequirement(required.kind, required.name)}{hint}"
    )


def resolve(root: PackageId, wanted: str, entries: Entries) -> dict[PackageId, IndexEntry]:
    """Return a compatible version of `root` and of each direct or indirect dependency.

    Args:
        root: the requested package.
        wanted: version range of the requested package.
        entries: all available versions, by package.

    Raises:
        PackageError: the dependencies conflict; the message lists the conflicting packages.
    """
    resolver: Resolver[_Need, IndexEntry, PackageId] = Resolver(_Provider(entries), BaseReporter())
    try:
        result = resolver.resolve([_Need(root, wanted)], max_rounds=_ROUNDS)
    except ResolutionImpossible as error:
        raise PackageError(_conflict(error, entries)) from None
    except ResolutionTooDeep:
        raise PackageError(
            f"{root}: its dependencies could not be resolved in {_ROUNDS} steps"
        ) from None
    if len(result.mapping) > _PACKAGES_MOST:
        raise PackageError(f"{root} needs more than {_PACKAGES_MOST} packages")
    return dict(sorted(result.mapping.items()))


class _Provider(AbstractProvider[_Need, IndexEntry, PackageId]):
    def __init__(self, entries: Entries) -> None:
        self._entries = entries

    def identify(self, requirement_or_candidate: _Need | IndexEntry) -> PackageId:
        return requirement_or_candidate.key

    def get_preference(
        self,
        identifier: PackageId,
        resolutions: Mapping[PackageId, IndexEntry],
        candidates: Mapping[PackageId, Iterator[IndexEntry]],
        information: Mapping[PackageId, Iterator[Any]],
        backtrack_causes: Sequence[Any],
    ) -> tuple[bool, PackageId]:
        """Return a sort key that puts packages with an earlier conflict first."""
        causes = {cause.requirement.key for cause in backtrack_causes}
        return identifier not in causes, identifier

    def find_matches(
        self,
        identifier: PackageId,
        requirements: Mapping[PackageId, Iterator[_Need]],
        incompatibilities: Mapping[PackageId, Iterator[IndexEntry]],
    ) -> list[IndexEntry]:
        needs = list(requirements.get(identifier, ()))
        refused = {entry.version for entry in incompatibilities.get(identifier, ())}
        found = [
            entry
            for entry in self._entries.get(identifier, ())
            if entry.language == LANGUAGE
            and entry.version not in refused
            and all(self.is_satisfied_by(need, entry) for need in needs)
        ]
        return sorted(found, key=lambda entry: entry.number, reverse=True)

    def is_satisfied_by(self, requirement: _Need, candidate: IndexEntry) -> bool:
        return _allows(requirement.wanted, candidate.version)

    def get_dependencies(self, candidate: IndexEntry) -> list[_Need]:
        return [_Need(parse_key(key), wanted) for key, wanted in candidate.needs.items()]


@lru_cache(maxsize=65536)
def _allows(wanted: str, version: str) -> bool:
    """Return whether a version is in a range. The result is cached for repeated queries."""
    return parse_range(wanted).allows(parse_version(version))


def _conflict(error: "ResolutionImpossible[_Need, IndexEntry]", entries: Entries) -> str:
    """Return a message with each conflicting requirement and the available versions."""
    causes: Iterable[Any] = error.causes
    asked: dict[PackageId, list[str]] = {}
    for cause in causes:
        who = str(cause.parent) if cause.parent is not None else "you"
        verb = "ask for" if cause.parent is None else "needs"
        line = f"{who} {verb} {cause.requirement.wanted}"
        if line not in (lines := asked.setdefault(cause.requirement.key, [])):
            lines.append(line)
    return "; ".join(f"{key}: {', '.join(lines)}; {_there_is(key, entries)}"
                     for key, lines in sorted(asked.items()))  # fmt: skip


def _there_is(key: PackageId, entries: Entries) -> str:
    known = sorted(entries.get(key, ()), key=lambda entry: entry.number)
    usable = [entry.version for entry in known if entry.language == LANGUAGE]
    if usable:
        shown = ", ".join(usable[-8:])
        return f"there is {shown}" if len(usable) <= 8 else f"there is …, {shown}"
    return "every version requires a different version of URC" if known else "there is none"
