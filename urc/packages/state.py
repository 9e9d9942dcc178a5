"""What is installed, as ``state.json`` says it: pure steps from one state to the next."""

from collections.abc import Iterable, Mapping
from typing import Annotated

import msgspec

from urc.packages.lock import Lock, Pin
from urc.packages.names import Key, PackageError, parse_key
from urc.packages.plan import Plan
from urc.packages.signature import fingerprint

__all__ = ["State"]


class State(msgspec.Struct, frozen=True, omit_defaults=True):
    """All that a store knows beside the archives themselves."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    installed: tuple[Lock, ...]
    keys: dict[str, str] = {}
    """``drivers/puppet`` → public key that signed it when it was first installed. They stay when a
    package is removed: else removing it would be a way round them."""
    before: dict[str, Lock] = {}
    """Digest of an installed lock → what an update replaced by it: the one step back."""

    def with_installed(self, plan: Plan) -> "State":
        """Return the state with what was planned. Another version of it stays beside it."""
        lock = plan.lock
        others = [one for one in self.installed if not _same(one, lock)]
        return self._next((*others, lock), self.before, plan)

    def with_update(self, old: Lock, plan: Plan) -> "State":
        """Return the state with one lock in the place of another, which is kept for going back."""
        gone = (old, plan.lock)
        others = [one for one in self.installed if not any(_same(one, lock) for lock in gone)]
        return self._next((*others, plan.lock), {**self.before, plan.lock.digest: old}, plan)

    def with_back(self, lock: Lock) -> "State":
        """Return the state with what `lock` had replaced; doing it again undoes it.

        Raises:
            PackageError: nothing is known that it replaced.
        """
        old = self.before.get(lock.digest)
        if old is None:
            raise PackageError(f"{lock} was not updated here; there is nothing to go back to")
        others = [one for one in self.installed if not (_same(one, old) or _same(one, lock))]
        return self._next((*others, old), {**self.before, old.digest: lock}, None)

    def without(self, gone: Iterable[Lock]) -> "State":
        """Return the state without some locks."""
        digests = {lock.digest for lock in gone}
        kept = tuple(lock for lock in self.installed if lock.digest not in digests)
        return self._next(kept, self.before, None)

    def without_key(self, key: Key) -> "State":
        """Return the state that takes any signature of a package; raise `PackageError`."""
        if str(key) not in self.keys:
            known = ", ".join(sorted(self.keys)) or "none"
            raise PackageError(f"no key is kept for {key}; there are keys for: {known}")
        keys = {name: one for name, one in self.keys.items() if name != str(key)}
        return msgspec.structs.replace(self, keys=keys)

    @property
    def kept(self) -> tuple[Lock, ...]:
        """Everything whose archives are still needed."""
        return (*self.installed, *self.before.values())

    def check(self, plan: Plan) -> None:
        """Raise `PackageError` where a plan is not what was agreed to before.

        Other bytes of a version that is known, a signature that is none, another key than the one
        that was kept, or no signature where there was one.
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
            found = f"signed by another key, {signature}," if signature else "not signed, other"
            raise PackageError(
                f"{name} {pin.version} is {found} than {fingerprint(kept)} that was kept when it"
                " was first installed: do not install it, unless its publisher confirms the change;"
                f" then 'urc repo key forget {name}' first"
            )

    def _check_known(self, name: str, pin: Pin) -> None:
        """Refuse other bytes under a version that is known: nobody may change one silently."""
        for lock in self.kept:
            known = lock.packages.get(name)
            if known and known.version == pin.version and known.sha256 != pin.sha256:
                raise PackageError(
                    f"{name} {pin.version} is installed with other bytes (by {lock});"
                    " a changed package needs a new version"
                )

    def _next(
        self, installed: tuple[Lock, ...], before: Mapping[str, Lock], plan: Plan | None
    ) -> "State":
        """Return the next state: sorted, with new keys, without steps back of what is gone."""
        digests = {lock.digest for lock in installed}
        keys = dict(self.keys)
        if plan is not None:
            for name, pin in plan.lock.packages.items():
                signature = plan.signatures.get(pin.sha256)
                if signature is not None and name not in plan.own:
                    keys.setdefault(name, signature.key)
        return State(
            1,
            tuple(sorted(installed, key=lambda lock: (lock.root, lock.number))),
            keys,
            {digest: lock for digest, lock in before.items() if digest in digests},
        )


def _same(one: Lock, other: Lock) -> bool:
    return (one.root, one.version) == (other.root, other.version)
