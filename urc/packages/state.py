"""The state of installed packages in ``state.json``, and pure functions that return a new state."""

from collections.abc import Iterable, Mapping
from typing import Annotated

import msgspec

from urc.packages.install_plan import InstallPlan
from urc.packages.lock import Lock, Pin
from urc.packages.names import PackageError, PackageId, parse_key
from urc.packages.signature import fingerprint

__all__ = ["StoreState"]


class StoreState(msgspec.Struct, frozen=True, omit_defaults=True):
    """The state of a store: installed locks, pinned keys, waivers and undo steps."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    installed: tuple[Lock, ...]
    keys: dict[str, str] = {}
    """Public key from the first installation, by package name, such as ``drivers/puppet``. Removing
    a package keeps its key; otherwise, a reinstallation would bypass the key check.
    """
    before: dict[str, Lock] = {}
    """Previous lock, for undoing the last update, by digest of the installed lock."""
    waived: tuple[str, ...] = ()
    """Packages that the user accepts without a signature in every installation, sorted."""

    def with_installed(self, plan: InstallPlan) -> "StoreState":
        """Return the state in which a plan's packages are also installed.

        Other versions of the package remain installed.
        """
        lock = plan.lock
        others = [one for one in self.installed if not _same(one, lock)]
        return self._next((*others, lock), self.before, plan)

    def with_update(self, old: Lock, plan: InstallPlan) -> "StoreState":
        """Return the state after replacing the lock `old`, with an undo step that restores it."""
        gone = (old, plan.lock)
        others = [one for one in self.installed if not any(_same(one, lock) for lock in gone)]
        return self._next((*others, plan.lock), {**self.before, plan.lock.digest: old}, plan)

    def with_back(self, lock: Lock) -> "StoreState":
        """Return the state without the update to `lock`. A second call undoes the first call.

        Raises:
            PackageError: no update to `lock` is recorded.
        """
        old = self.before.get(lock.digest)
        if old is None:
            raise PackageError(f"{lock} has no update to undo")
        others = [one for one in self.installed if not (_same(one, old) or _same(one, lock))]
        return self._next((*others, old), {**self.before, old.digest: lock}, None)

    def without(self, gone: Iterable[Lock]) -> "StoreState":
        """Return the state without the locks in `gone`."""
        digests = {lock.digest for lock in gone}
        kept = tuple(lock for lock in self.installed if lock.digest not in digests)
        return self._next(kept, self.before, None)

    def without_key(self, key: PackageId) -> "StoreState":
        """Return the state without a package's pinned key; raise `PackageError` if it has none."""
        if str(key) not in self.keys:
            known = ", ".join(sorted(self.keys)) or "none"
            raise PackageError(f"no key is pinned for {key}; keys are pinned for: {known}")
        keys = {name: one for name, one in self.keys.items() if name != str(key)}
        return msgspec.structs.replace(self, keys=keys)

    def with_waiver(self, key: PackageId) -> "StoreState":
        """Return the state that accepts a package without a signature."""
        return msgspec.structs.replace(self, waived=tuple(sorted({*self.waived, str(key)})))

    def without_waiver(self, key: PackageId) -> "StoreState":
        """Return the state without a package's waiver; raise `PackageError` if it has no waiver."""
        if str(key) not in self.waived:
            known = ", ".join(self.waived) or "none"
            raise PackageError(f"{key} has no waiver; waivers exist for: {known}")
        return msgspec.structs.replace(
            self, waived=tuple(one for one in self.waived if one != str(key))
        )

    @property
    def kept(self) -> tuple[Lock, ...]:
        """All installed locks, and the locks that an undo step can restore."""
        return (*self.installed, *self.before.values())

    def check(self, plan: InstallPlan) -> None:
        """Raise `PackageError` for a plan that contradicts installed packages or pinned keys.

        The state rejects different bytes of a known version, invalid signatures, and keys that
        differ from the pinned key. The state also rejects a missing signature, except for the
        packages in `lacking`.
        """
        for name, pin in plan.lock.packages.items():
            self._check_known(name, pin)
            signature = plan.signatures.get(pin.sha256)
            if signature is not None:
                signature.check(parse_key(name), pin.version, pin.sha256)
            kept = self.keys.get(name)
            is_kept = signature is not None and signature.key == kept
            if kept is None or is_kept or name in plan.own:
                continue
            found = f"signed by another key, {signature}" if signature else "not signed"
            raise PackageError(
                f"{name} {pin.version} is {found}, but the key {fingerprint(kept)} was pinned at"
                " the first installation; if its publisher confirms the change, run"
                f" 'urc repo key forget {name}' and install the package again"
            )
        if lacking := self.lacking(plan):
            names = [f"{name} {plan.lock.packages[name].version}" for name in lacking]
            options = " ".join(f"--allow-unsigned {name}" for name in lacking)
            raise PackageError(
                f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'} not signed, so anyone"
                f" could have changed the content; to accept it anyway, add: {options}"
            )

    def lacking(self, plan: InstallPlan) -> list[str]:
        """Return a plan's packages that lack the required signature.

        Packages from a named folder, packages with a waiver, and the exact bytes of installed
        packages need no signature.
        """
        known = {(name, pin) for lock in self.kept for name, pin in lock.packages.items()}
        accepted = {*plan.own, *plan.waived, *self.waived}
        return [
            name
            for name, pin in plan.lock.packages.items()
            if pin.sha256 not in plan.signatures
            and name not in accepted
            and (name, pin) not in known
        ]

    def _check_known(self, name: str, pin: Pin) -> None:
        """Reject different bytes for a known version, because users would not notice the change."""
        for lock in self.kept:
            known = lock.packages.get(name)
            if known and known.version == pin.version and known.sha256 != pin.sha256:
                raise PackageError(
                    f"{name} {pin.version} is already installed with different content (by {lock});"
                    " a changed package needs a new version"
                )

    def _next(
        self, installed: tuple[Lock, ...], before: Mapping[str, Lock], plan: InstallPlan | None
    ) -> "StoreState":
        """Return the next state: sorted, with new keys, without undo steps for removed locks."""
        digests = {lock.digest for lock in installed}
        keys = dict(self.keys)
        if plan is not None:
            for name, pin in plan.lock.packages.items():
                signature = plan.signatures.get(pin.sha256)
                if signature is not None and name not in plan.own:
                    keys.setdefault(name, signature.key)
        return StoreState(
            1,
            tuple(sorted(installed, key=lambda lock: (lock.root, lock.number))),
            keys,
            {digest: lock for digest, lock in before.items() if digest in digests},
            self.waived,
        )


def _same(one: Lock, other: Lock) -> bool:
    return (one.root, one.version) == (other.root, other.version)
