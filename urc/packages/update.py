"""Updates of installed packages: list, preview, install and undo.

The command line and the pages use the same functions. `newer` lists updates, and `plan_update`
downloads one update. After `StoreTransaction.stage`, `staged_difference` returns the changes.
`StoreTransaction.replace` installs the update, and `StoreTransaction.back` undoes it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from urc._translatable import phrase
from urc.packages.install import Found, plan_root, settle, without_blocked
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import Lock, lock_of
from urc.packages.names import PackageError
from urc.packages.sources import Source, merged, offered
from urc.packages.store import Store, kinds_in
from urc.packages.versions import parse_version

__all__ = [
    "UpdateDiff",
    "AvailableUpdate",
    "PackageSummary",
    "differences",
    "headline",
    "newer",
    "plan_update",
    "staged_difference",
    "version_lines",
]


class AvailableUpdate(NamedTuple):
    """An available update."""

    old: Lock
    new: Lock

    @property
    def lines(self) -> list[str]:
        """Changed versions, one line for each package."""
        return version_lines(self.old, self.new)


class PackageSummary(Protocol):
    """The preview of a package's documents, implemented by `urc.runtime.package_preview`."""

    @property
    def permissions(self) -> Sequence[str]:
        """Permissions of the package, one line each."""

    @property
    def risks(self) -> Sequence[str]:
        """Local resources that the package itself specifies, one line each."""

    @property
    def wire(self) -> Mapping[str, str]:
        """Values of all keys that affect the sent bytes, by path in the document."""


Look = Callable[[Path, Path, Sequence[str]], PackageSummary]
"""Function that returns a preview from the document, the package's folder and the widget names."""


class UpdateDiff(NamedTuple):
    """The changes that an update makes to versions, permissions and sent bytes."""

    versions: list[str]
    """Changed versions, such as ``widgets/dial 1.0.0 → 1.1.0``."""
    gained: list[str]
    """New permissions."""
    lost: list[str]
    risks: list[str]
    """Local resources that the new version itself specifies, but the old version does not."""
    wire: list[str]
    """Changed keys, such as ``- commands.beep.send: "beep"`` and ``+ commands.beep.send:
    "BEEP"``."""


def newer(
    store: Store, sources: Sequence[Source], complain: Callable[[str], None]
) -> list[AvailableUpdate]:
    """Return the available updates; download only the repositories' indexes.

    If several versions of a package are installed, only the newest version is compared with the
    sources.

    Args:
        store: store with the installed packages.
        sources: repositories, in the order in which they are queried.
        complain: callback that receives a message about each unreachable repository and each
            dependency conflict.

    Raises:
        PackageError: the store cannot be read.
    """
    found = without_blocked(offered(merged(sources, complain)), store)
    updates = []
    for lock in _newest(store.installed()):
        if lock.key not in found:
            continue
        try:
            new = _lock(lock, "*", found)
        except PackageError as error:
            complain(str(error))
            continue
        if new is not None:
            updates.append(AvailableUpdate(lock, new))
    return updates


def plan_update(
    old: Lock,
    sources: Sequence[Source],
    store: Store,
    complain: Callable[[str], None],
    wanted: str = "*",
) -> InstallPlan | None:
    """Return the install plan for the newest version, with archives; None if there is no update.

    Args:
        old: the installed package's lock.
        sources: package sources, as for `newer`.
        store: the store with this package.
        complain: callback that receives warnings for the user.
        wanted: version range; the newest version in this range is installed.

    Raises:
        PackageError: no source has the package, its dependencies conflict, or an archive differs
            from the index.
    """
    found = without_blocked(offered(merged(sources, complain)), store)
    if old.key not in found:
        raise PackageError(f"no repository has {old.root}; the installed version remains in use")
    new = _lock(old, wanted, found)
    return None if new is None else plan_root(old.key, new.version, found, store)


def staged_difference(
    old: Lock, plan: InstallPlan, store: Store, staged: Path, look: Look
) -> UpdateDiff:
    """Return the changes that a staged update makes.

    Args:
        old: the installed package's lock.
        plan: install plan for the update.
        store: store that contains both versions.
        staged: result of `StoreTransaction.stage` for the plan.
        look: function that returns the preview of a package's documents.

    Raises:
        UrcError: the new document has errors or refers to a file outside its package.
    """
    before = _seen(old, store.make(old), look)
    after = _seen(plan.lock, staged, look)
    gained, lost = differences(before.permissions, after.permissions)
    risks = [line for line in after.risks if line not in before.risks]
    wire = _wire_lines(before.wire, after.wire)
    return UpdateDiff(version_lines(old, plan.lock), gained, lost, risks, wire)


def differences(before: Iterable[str], after: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return the items that are only in `after` and the items that are only in `before`."""
    old, new = list(before), list(after)
    return [one for one in new if one not in old], [one for one in old if one not in new]


def headline(old: Lock, new: Lock) -> str:
    """Return a package's version change as text, such as ``drivers/puppet 1.0.0 → 1.1.0``."""
    return str(old) if old.version == new.version else f"{old} → {new.version}"


def version_lines(old: Lock, new: Lock) -> list[str]:
    """Return one line for each package whose version differs between two locks."""
    lines: list[str] = []
    for name in sorted({*old.packages, *new.packages}):
        before, after = old.packages.get(name), new.packages.get(name)
        if before is None:
            lines.append(
                phrase("{package}, new", package=f"{name} {after.version if after else ''}")
            )
        elif after is None:
            lines.append(phrase("{package}, no longer needed", package=f"{name} {before.version}"))
        elif before.version != after.version:
            step = f"{name} {before.version} → {after.version}"
            is_older = parse_version(after.version) < parse_version(before.version)
            lines.append(phrase("{step}, which is older", step=step) if is_older else step)
    return lines


def _seen(lock: Lock, folder: Path, look: Look) -> PackageSummary:
    document = folder / lock.root / f"{lock.key.kind}.yaml"
    return look(document, folder, [key.name for key in kinds_in(lock, "widget")])


def _wire_lines(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    lines = []
    for place in dict.fromkeys((*before, *after)):
        if before.get(place) != after.get(place):
            lines += [f"- {place}: {before[place]}"] if place in before else []
            lines += [f"+ {place}: {after[place]}"] if place in after else []
    return lines


def _newest(locks: Iterable[Lock]) -> list[Lock]:
    found: dict[str, Lock] = {}
    for lock in locks:
        other = found.get(lock.root)
        if other is None or other.number < lock.number:
            found[lock.root] = lock
    return list(found.values())


def _lock(old: Lock, wanted: str, found: Found) -> Lock | None:
    """Return the newest version's lock; None if this lock does not update `old`."""
    new = lock_of(old.key, settle(old.key, wanted, found))
    if new == old or new.number < old.number:
        return None
    if new.number == old.number and not _is_step_up(old, new):
        return None
    return new


def _is_step_up(old: Lock, new: Lock) -> bool:
    """Return whether at least one dependency is newer and no dependency is older."""
    pairs = [
        (parse_version(pin.version), parse_version(new.packages[name].version))
        for name, pin in old.packages.items()
        if name in new.packages
    ]
    return all(before <= after for before, after in pairs) and any(
        before < after for before, after in pairs
    )
