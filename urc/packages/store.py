"""The user's installed packages on this machine, which are usable without a network.

    packages/
      state.json              installed packages, one lock each, and pinned keys
      blocks.json             known lists of blocked packages
      blobs/<sha256>.zip      the archives, each under the digest of its bytes
      signatures/<sha256>.json  signatures of the archives, if any
      ecosystems/<sha256>/    the files of one lock, extracted from its blobs
      work/                   incomplete files, and files to delete

Only `state.json` defines the installed packages, and it changes atomically. Each change also
deletes all files that `state.json` does not refer to. The store is therefore always consistent.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import msgspec

from urc.packages import atomic_files
from urc.packages.archive import PACKAGE, read_archive
from urc.packages.block_store import BlockStore
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import LOCK, Lock, read_lock
from urc.packages.manifest import Manifest
from urc.packages.names import PackageError, PackageId, PackageRequirement, parse_key
from urc.packages.package import open_package, sha256
from urc.packages.signature import Signature
from urc.packages.state import StoreState
from urc.packages.versions import parse_range, parse_version

__all__ = ["StoreTransaction", "Store", "blocked_lines_of", "ecosystem_of", "kinds_in"]

_STATE_BYTES: Final = 16 << 20
_LOCK_BYTES: Final = 1 << 20


class Store:
    """The installed packages in one folder. The first installation creates the folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.work = folder / "work"
        self.blocks = BlockStore(folder)
        """Stored block lists."""
        self._state = folder / "state.json"

    def installed(self) -> tuple[Lock, ...]:
        """Return the locks of all requested packages, sorted by name and version.

        Raises:
            PackageError: the state cannot be read.
        """
        return self.state().installed

    def state(self) -> StoreState:
        """Return the store's state; raise `PackageError` on failure."""
        try:
            with open(self._state, "rb") as file:
                data = file.read(_STATE_BYTES)
        except FileNotFoundError:
            return StoreState(1, ())
        try:
            return msgspec.json.decode(data, type=StoreState)
        except (msgspec.DecodeError, PackageError, UnicodeDecodeError) as error:
            raise PackageError(f"{self._state}: this file is damaged: {error}") from None

    def previous(self, lock: Lock) -> Lock | None:
        """Return the lock from before the update to `lock`, or None if there was no update."""
        return self.state().before.get(lock.digest)

    def find(self, required: PackageRequirement) -> Lock | None:
        """Return the newest installed version for a requirement, or None.

        Raises:
            PackageError: packages of several kinds have this name.
        """
        found = _meant(required, self.installed())
        return max(found, key=lambda lock: lock.number, default=None)

    def document(self, lock: Lock) -> Path:
        """Return the document of an installed package, after comparing its files with the archives.

        Raises:
            PackageError: the package is blocked, or both the files and the archives are damaged.
        """
        self.check_use(lock)
        folder = self.place(lock)
        if not _holds(folder, self._files(lock)):
            with self.changing():
                self.make(lock)
        return folder / lock.root / f"{lock.key.kind}.yaml"

    def blocked(self, lock: Lock) -> list[str]:
        """Return one line for each blocked package in a lock; raise `PackageError` on failure."""
        return self.blocks.lines(lock, self.signature)

    def check_use(self, lock: Lock) -> None:
        """Raise `PackageError` if the package or a dependency is blocked."""
        _check_blocks(self.blocked(lock))

    def place(self, lock: Lock) -> Path:
        """Return the path of the folder for a lock's files, which may not exist."""
        return self.folder / "ecosystems" / lock.digest

    def blob(self, digest: str) -> bytes:
        """Return an archive in the store; raise `PackageError` for a missing or damaged archive."""
        try:
            with open(self.blob_file(digest), "rb") as file:
                data = file.read(PACKAGE.archive_bytes + 1)
        except FileNotFoundError:
            data = b""
        if sha256(data) != digest:
            raise PackageError(
                f"{self.blob_file(digest)}: this archive is missing or damaged; install it again"
            )
        return data

    def has(self, digest: str) -> bool:
        """Return whether an archive is in the store."""
        return self.blob_file(digest).is_file()

    def blob_file(self, digest: str) -> Path:
        """Return the path of an archive, which may be missing."""
        return self.folder / "blobs" / f"{digest}.zip"

    def signature(self, digest: str) -> Signature | None:
        """Return an archive's unverified signature, or None."""
        try:
            with open(self._signature_file(digest), "rb") as file:
                return msgspec.json.decode(file.read(4096), type=Signature)
        except (FileNotFoundError, msgspec.DecodeError, UnicodeDecodeError):
            return None

    def keep_signature(self, digest: str, signature: Signature) -> None:
        """Store an archive's signature. Only `StoreTransaction` may call this method."""
        if self.signature(digest) != signature:
            data = msgspec.json.encode(signature) + b"\n"
            atomic_files.put_file(self._signature_file(digest), data, self.work)

    def make(self, lock: Lock) -> Path:
        """Return the folder with a lock's files; extract incomplete files again.

        The caller must hold the lock that `changing` acquires.

        Raises:
            PackageError: an archive is missing or damaged.
        """
        files = self._files(lock)
        if not _holds(self.place(lock), files):
            atomic_files.put_folder(self.place(lock), files, self.work)
        return self.place(lock)

    def _signature_file(self, digest: str) -> Path:
        return self.folder / "signatures" / f"{digest}.json"

    @contextmanager
    def changing(self) -> Iterator["StoreTransaction"]:
        """Lock the store against other processes; at the end, delete unused files."""
        with atomic_files.exclusive(self.folder / "changing"):
            with suppress(OSError):
                atomic_files.clear(self.work)
            change = StoreTransaction(self)
            try:
                yield change
            finally:
                with suppress(OSError, PackageError):
                    self._collect()

    def write_state(self, state: StoreState) -> None:
        """Write the state. Only `StoreTransaction` may call this method."""
        data = msgspec.json.format(msgspec.json.encode(state, order="sorted"), indent=1)
        atomic_files.put_file(self._state, data + b"\n", self.work)

    def _files(self, lock: Lock) -> dict[str, bytes]:
        """Return the files that a lock's folder should contain."""
        files = {LOCK: lock.to_bytes()}
        for key, pin in lock.packages.items():
            for path, data in read_archive(self.blob(pin.sha256), PACKAGE, key).items():
                files[f"{key}/{path}"] = data
        return files

    def _collect(self) -> None:
        """Delete the files of removed locks; a later change deletes files that are still in use."""
        locks = self.state().kept
        digests = {pin.sha256 for lock in locks for pin in lock.packages.values()}
        for folder, wanted in (
            # Replaced locks keep their files, because a dashboard may still use them.
            ("ecosystems", {lock.digest for lock in locks}),
            ("blobs", {f"{digest}.zip" for digest in digests}),
            ("signatures", {f"{digest}.json" for digest in digests}),
        ):
            if (self.folder / folder).is_dir():
                for entry in (self.folder / folder).iterdir():
                    if entry.name not in wanted:
                        atomic_files.discard(entry, self.work)
        atomic_files.clear(self.work)


class StoreTransaction:
    """A transaction that changes the store while other processes are locked out."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def stage(self, plan: InstallPlan) -> Path:
        """Extract a plan's files for a preview, without installing the packages.

        Returns:
            The folder with the files, which has a subfolder for each kind:
            ``drivers/puppet/driver.yaml``.

        Raises:
            PackageError: an archive differs from the lock or from an installed version, a signature
                is not accepted, or a package is blocked.
        """
        store = self._store
        store.state().check(plan)
        signatures = plan.signatures
        _check_blocks(
            store.blocks.lines(plan.lock, lambda one: signatures.get(one) or store.signature(one))
        )
        opened = []
        for key, pin in plan.lock.packages.items():
            data = plan.archives.get(pin.sha256)
            if data is None:
                data = store.blob(pin.sha256)
            elif sha256(data) != pin.sha256:
                raise PackageError(
                    f"{key} {pin.version}: the archive does not match the digest in the lock"
                )
            said = open_package(data, f"{key} {pin.version}").manifest
            if (str(said.key), said.version) != (key, pin.version):
                raise PackageError(
                    f"{key} {pin.version}: found {said.key} {said.version} in the archive"
                )
            opened.append(said)
            if pin.sha256 in plan.archives:
                atomic_files.put_file(store.blob_file(pin.sha256), data, store.work)
            if signature := plan.signatures.get(pin.sha256):
                store.keep_signature(pin.sha256, signature)
        for said in opened:
            _check_needs(said, plan.lock)
        return store.make(plan.lock)

    def commit(self, plan: InstallPlan) -> None:
        """Install a staged plan. Other versions of the package remain installed."""
        self._store.write_state(self._store.state().with_installed(plan))

    def replace(self, old: Lock, plan: InstallPlan) -> None:
        """Replace the lock `old` with a staged plan. The method `back` can restore `old`."""
        self._store.write_state(self._store.state().with_update(old, plan))

    def back(self, lock: Lock) -> Lock:
        """Undo the update to `lock`; raise `PackageError` if no update to `lock` is recorded."""
        state = self._store.state().with_back(lock)
        old = self._store.state().before[lock.digest]
        self._store.check_use(old)
        self._store.make(old)
        self._store.write_state(state)
        return old

    def remove(self, required: PackageRequirement) -> tuple[list[Lock], list[str]]:
        """Remove an installed package and its unused dependencies.

        Returns:
            The removed locks, and the names of all removed packages, such as ``drivers/puppet
            1.0.0``.

        Raises:
            PackageError: the package is not installed, or was installed only as a dependency.
        """
        state = self._store.state()
        gone = _meant(required, state.installed)
        if not gone:
            raise PackageError(_not_installed(required, state.installed))
        after = state.without(gone)
        self._store.write_state(after)
        return gone, sorted(_all(state.installed) - _all(after.installed))

    def forget_key(self, key: PackageId) -> None:
        """Delete a package's pinned key; raise `PackageError` if no key is pinned.

        The next installation accepts any valid signature of the package.
        """
        self._store.write_state(self._store.state().without_key(key))

    def waive(self, key: PackageId) -> None:
        """Accept a package without a signature in every installation."""
        self._store.write_state(self._store.state().with_waiver(key))

    def end_waiver(self, key: PackageId) -> None:
        """Require a package's signature again; raise `PackageError` without a waiver."""
        self._store.write_state(self._store.state().without_waiver(key))


def _check_blocks(lines: Sequence[str]) -> None:
    if lines:
        raise PackageError("; ".join(lines))


def _check_needs(said: Manifest, lock: Lock) -> None:
    """Check that the index and the package declare the same dependencies."""
    for need, wanted in said.needs.items():
        pin = lock.packages.get(need)
        if pin is None or not parse_range(wanted).allows(parse_version(pin.version)):
            found = f"is in the lock as {pin.version}" if pin else "is not in the lock"
            raise PackageError(
                f"{said.key} {said.version} needs {need} {wanted}, but this dependency {found}:"
                " the index and the package disagree"
            )


def ecosystem_of(document: Path) -> Path | None:
    """Return the folder that contains an installed document's files, or None."""
    for folder in document.resolve().parents:
        if (folder / LOCK).is_file():
            return folder
    return None


def blocked_lines_of(document: Path) -> list[str]:
    """Return one line for each blocked package that an installed document uses.

    Raises:
        PackageError: the document's lock or the file with the block lists is damaged.
    """
    folder = ecosystem_of(document)
    if folder is None:
        return []
    with open(folder / LOCK, "rb") as opened:
        lock = read_lock(opened.read(_LOCK_BYTES), str(folder / LOCK))
    return Store(folder.parent.parent).blocked(lock)


def _meant(required: PackageRequirement, locks: tuple[Lock, ...]) -> list[Lock]:
    """Return the locks that match a requirement. Without a range, all installed versions match."""
    wanted = parse_range(required.range)
    found = [
        lock
        for lock in locks
        if lock.key.name == required.name
        and required.kind in ("", lock.key.kind)
        and (required.range == "*" or wanted.allows(lock.number))
    ]
    if len({lock.key for lock in found}) > 1:
        names = ", ".join(sorted({lock.root for lock in found}))
        raise PackageError(f"{required.name!r} is ambiguous; expected one of {names}")
    return found


def _all(locks: tuple[Lock, ...]) -> set[str]:
    return {f"{key} {pin.version}" for lock in locks for key, pin in lock.packages.items()}


def _not_installed(required: PackageRequirement, locks: tuple[Lock, ...]) -> str:
    needed = [
        f"{lock} needs {key} {pin.version}"
        for lock in locks
        for key, pin in lock.packages.items()
        if key != lock.root
        and parse_key(key).name == required.name
        and required.kind in ("", parse_key(key).kind)
    ]
    if needed:
        return f"{required} was installed only as a dependency: {'; '.join(needed)}"
    names = ", ".join(map(str, locks)) or "nothing"
    return f"{required} is not installed; installed: {names}"


def _holds(folder: Path, files: Mapping[str, bytes]) -> bool:
    """Return whether a folder contains exactly these files."""
    found = 0
    for parent, folders, names in os.walk(folder):
        for name in names:
            path = Path(parent, name)
            wanted = files.get(path.relative_to(folder).as_posix())
            if wanted is None or path.is_symlink() or path.stat().st_size != len(wanted):
                return False
            if path.read_bytes() != wanted:
                return False
            found += 1
        if any(Path(parent, name).is_symlink() for name in folders):
            return False
    return found == len(files)


def kinds_in(lock: Lock, kind: str) -> list[PackageId]:
    """Return the packages of one kind in a lock."""
    return [key for key in map(parse_key, lock.packages) if key.kind == kind]
