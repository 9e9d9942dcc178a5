"""A package manager that keeps the menu's robots consistent with the installed packages.

Layer 5. The manager has no routes and no pages: `urc.web.manage.routes` uses it.
"""

import asyncio
import logging
from collections.abc import Callable, Iterable
from pathlib import Path
from urllib.parse import quote

from urc._daemon import in_daemon
from urc.model.profile import Profile
from urc.packages.index import IndexEntry
from urc.packages.lock import Lock
from urc.packages.names import PackageError, PackageId, PackageRequirement, parse_requirement
from urc.packages.repositories import Repository
from urc.packages.sources import Source
from urc.problems import UrcError, printable
from urc.runtime.settings_store import DRIVEN, in_use, names_kept, pin
from urc.web.fleet.fleet import BrokenRobot, Fleet
from urc.web.fleet.robot_factory import RobotFactory
from urc.web.fleet.robots import Robot
from urc.web.manage.block_watch import BlockWatch
from urc.web.manage.catalogue import PackageCatalog
from urc.web.manage.jobs import Busy, Job, Jobs
from urc.web.manage.wire import MOST_HITS, Available, Installed, PackageList
from urc.web.words import spoken

__all__ = ["Manager"]

log = logging.getLogger(__name__)


class Manager:
    """Changes packages, repositories and settings on behalf of the manager pages."""

    def __init__(
        self,
        factory: RobotFactory,
        fleet: Fleet,
        now: Callable[[], float],
        renew: Callable[[str, Robot], None],
    ) -> None:
        """Create the manager.

        Args:
            factory: the factory that creates the robots.
            fleet: the served robots.
            now: function that returns the current time, in seconds.
            renew: function that switches to another version of a robot; may raise `UrcError`.
        """
        self.factory = factory
        self.fleet = fleet
        self._renew = renew
        self.catalogue = PackageCatalog(factory.robot_options.data / "packages", now)
        self.jobs = Jobs(factory.store, self._sources, self._used)
        self._block_watch = BlockWatch(
            factory.store,
            fleet,
            lambda name, robot: factory.robot(name, self.document_of(name, robot)),
            lambda name, robot: set(self.document_of(name, robot).interfaces),
            lambda: self.catalogue.refresh(force=True),
        )
        self._packages: dict[str, Lock] = {}
        """Served version of each robot from an installed package, keyed by robot name."""
        self._offered: dict[str, str] = {}
        """Digest of each installed interface, keyed by name."""
        self._seen: object = None
        """State of the package store when the menu was last updated."""
        self._is_behind = False
        """Whether any change is pending because a robot is being driven."""
        self._changing = asyncio.Lock()

    def _sources(self, complain: Callable[[str], None]) -> list[Source]:
        known: list[Repository] = self.catalogue.repositories(complain).all()
        return list(known)

    async def close(self) -> None:
        """Abandon pending work."""
        await self.jobs.close()
        await self.catalogue.close()

    # The menu

    async def park(self) -> None:
        """Update the robots from installed packages, if the menu shows installed robots."""
        if not self.factory.robot_options.shows_installed:
            return
        installed = await asyncio.to_thread(self.factory.installed_robots)
        for name in [one for one in self._packages if one not in installed]:
            if self._waits(name):
                continue
            await self.fleet.remove(name)
            del self._packages[name]
        for name, locks in installed.items():
            if name in self.fleet.robots and name not in self._packages:
                continue  # a robot with this name was given at the start
            await self._park(name, locks)

    async def _park(self, name: str, locks: list[Lock]) -> None:
        try:
            kept = await asyncio.to_thread(self.factory.settings_store(name).load)
            lock, served = (
                self.factory.chosen_version(locks, kept.version),
                self._packages.get(name),
            )
            if served in locks and not kept.version:
                lock = served  # a newer version from another program needs the user's choice
            if name in self.fleet.robots and (served == lock or self._waits(name)):
                return
            profile = await asyncio.to_thread(self.factory.profile, lock)
            robot = await asyncio.to_thread(self.factory.robot, name, profile, kept)
            if name in self.fleet.robots:
                self._renew(name, robot)
            else:
                self.fleet.add(name, robot)
            self._packages[name] = lock
        except (UrcError, OSError) as error:
            text = str(error).strip().partition("\n")[0]
            self.fleet.broken[name] = BrokenRobot(name, text)
            self._packages.setdefault(name, locks[-1])

    def _waits(self, name: str) -> bool:
        """Return whether a robot is being driven; if so, record that its change is pending."""
        is_driven = name in self.fleet.robots and bool(self.fleet.driven_by(name))
        self._is_behind = self._is_behind or is_driven
        return is_driven

    async def refurnish(self) -> None:
        """Update the installed interfaces of all robots that are not being driven."""
        added = await asyncio.to_thread(self.factory.interfaces)
        now = {one.lock.key.name: one.lock.digest for one in added}
        changed = {name for name, _ in now.items() ^ self._offered.items()}
        self._offered = now
        if not changed:
            return
        for name, robot in list(self.fleet.robots.items()):
            if self.fleet.driven_by(name):
                continue
            try:
                profile = await asyncio.to_thread(self.document_of, name, robot)
                made = await asyncio.to_thread(self.factory.robot, name, profile)
                if changed & {*robot.profile.interfaces, *made.profile.interfaces}:
                    self._renew(name, made)
            except (UrcError, OSError) as error:
                log.warning("%s: %s", name, error)

    async def apply_settings(self, name: str, robot: Robot, version: str) -> None:
        """Switch a robot to new settings; raise `UrcError` if widget names conflict."""
        if name in self.fleet.robots:
            self._renew(name, robot)
        else:
            self.fleet.add(name, robot)
        if name in self._packages:
            locks = (await asyncio.to_thread(self.factory.installed_robots)).get(name)
            if locks:
                self._packages[name] = self.factory.chosen_version(locks, version)

    def document_of(self, name: str, robot: Robot) -> Profile:
        """Return a robot's profile from its document, without added interfaces."""
        lock = self._packages.get(name)
        if lock is not None:
            return self.factory.profile(lock)
        return self.factory.reload(robot.profile)

    def drivers(self) -> dict[str, str]:
        """Return robots' installed packages, such as ``drivers/puppet 1.0.0``, by robot name."""
        return {name: str(lock) for name, lock in self._packages.items()}

    def lock_of(self, name: str) -> Lock | None:
        """Return a robot's installed package; None for a robot given when the server started."""
        return self._packages.get(name)

    # Changes

    async def refresh(self) -> None:
        """Update the menu if any program has installed or removed a package."""
        if await asyncio.to_thread(self.factory.stamp) != self._seen:
            await self.changed()

    async def watch_blocks(self) -> None:
        """Stop and disable robots with blocked packages, until cancelled."""
        await self._block_watch.run(self._blocks_changed)

    async def _blocks_changed(self) -> None:
        """Stop and disable robots with blocked packages, then update the menu."""
        async with self._changing:  # `park` adds robots, too
            await self._block_watch.enforce()
        await self.changed()

    async def changed(self) -> None:
        """Update the menu from the installed packages."""
        async with self._changing:
            self._seen = await asyncio.to_thread(self.factory.stamp)
            self._is_behind = False
            try:
                await self.park()
                await self.refurnish()
                if self._is_behind:
                    self._seen = None
            except (UrcError, OSError) as error:  # the manager pages show this error, too
                log.warning("the installed packages cannot be read: %s", error)

    async def connect(self, url: str) -> None:
        """Add a repository; raise `PackageError` if the repository does not respond."""
        known = self.catalogue.repositories(log.info)
        await in_daemon(lambda: known.add(url), "connect")
        self.catalogue.refresh(force=True)

    async def disconnect(self, url: str) -> None:
        """Remove a repository; raise `PackageError` if it was never added."""
        known = self.catalogue.repositories(log.info)
        await asyncio.to_thread(known.remove, url)
        self.catalogue.refresh(force=True)

    def gone(self, required: PackageRequirement) -> list[str]:
        """Return all packages that a removal would remove, or raise `PackageError`."""
        before = self.factory.store.installed()
        meant = self._meant(required)
        after = [lock for lock in before if lock not in meant]
        return sorted(_all(before) - _all(after))

    def _meant(self, required: PackageRequirement) -> list[Lock]:
        """Return the installed packages that match a requirement, or raise `PackageError`."""
        meant = [
            lock
            for lock in self.factory.store.installed()
            if lock.key == PackageId(required.kind or lock.key.kind, required.name)
            and required.range in ("*", lock.version)
        ]
        if not meant:
            raise PackageError(f"{required} is not installed, or is installed only as a dependency")
        return meant

    def forgettable(self, required: PackageRequirement) -> list[str]:
        """Return the robots whose settings the removal can delete, or raise `PackageError`."""
        meant = self._meant(required)
        left = [lock for lock in self.factory.store.installed() if lock not in meant]
        return names_kept(self._kept_folder, meant, left)

    async def remove(self, text: str, *, forgets: bool = True) -> list[str]:
        """Remove a package and its unneeded dependencies; return the names of the removed packages.

        If `forgets` is true, the settings of the package's robot are deleted as well.

        Raises:
            PackageError: the package is not installed.
            Busy: an operator drives the package's robot.
        """
        required = parse_requirement(text)
        for lock in await asyncio.to_thread(self._meant, required):
            self._check_idle_of(lock.key)

        def work() -> list[str]:
            with self.factory.store.changing() as change:
                return change.remove(required)[1]

        names = await asyncio.to_thread(self.forgettable, required) if forgets else []
        gone = await asyncio.to_thread(work)
        for name in names:
            await asyncio.to_thread(self.factory.settings_store(name).forget)
        await self.changed()
        return gone

    async def agree(
        self, number: int, *, takes_risks: bool = False, unsigned: Iterable[str] = ()
    ) -> Job:
        """Install the planned package; raise `Busy` while its robot is being driven.

        The current version stays in use unless the job is an update.
        """
        key, used = await asyncio.to_thread(self.jobs.touched, number)
        if key is not None:
            self._check_idle_of(key)
        if used is not None and used.key.kind in DRIVEN:
            await asyncio.to_thread(pin, self._kept_folder, used)
        job = await self.jobs.agree(number, takes_risks=takes_risks, unsigned=unsigned)
        await self.changed()
        return job

    def installed(self, text: str) -> Lock:
        """Return the newest installed version of a package, or raise `PackageError`."""
        lock = self.factory.store.find(parse_requirement(text))
        if lock is None:
            raise PackageError(f"{text} is not installed")
        return lock

    async def back(self, text: str) -> Lock:
        """Restore and return the version before the last update, or raise `PackageError`."""
        lock = await asyncio.to_thread(self.installed, text)
        self._check_idle_of(lock.key)

        def work() -> Lock:
            with self.factory.store.changing() as change:
                return change.back(lock)

        old = await asyncio.to_thread(work)
        await self.changed()
        return old

    def _check_idle_of(self, key: PackageId) -> None:
        for name, lock in self._packages.items():
            if lock.key == key or (name == key.name and key.kind in DRIVEN):
                self.check_idle(name)

    def _used(self, key: PackageId) -> Lock | None:
        """Return the version in use of a package, or of a robot or driver with the same name."""
        installed = self.factory.store.installed()
        if key.kind in DRIVEN:
            return in_use(self._kept_folder, key.name, installed)
        mine = [lock for lock in installed if lock.key == key]
        return max(mine, key=lambda lock: lock.number, default=None)

    @property
    def _kept_folder(self) -> Path:
        return self.factory.robot_options.data / "robots"

    def check_idle(self, name: str, *, is_correction: bool = False) -> None:
        """Raise `Busy` while an operator drives the robot or a stop is pending.

        With `is_correction`, a pending stop for an unreachable robot does not count, because wrong
        settings may be why the robot is unreachable.
        """
        driver = self.fleet.driven_by(name)
        if driver and not (is_correction and self.fleet.is_out_of_reach(name)):
            raise Busy(f"{name} is being driven ({driver}): wait until the controls are free")

    # Data for pages

    def cache(self, words: str, kinds: tuple[str, ...], *, may_manage: bool) -> PackageList:
        """Return the package lists for a page.

        The method reads files, so call it in a thread.

        Args:
            words: search words for packages in repositories.
            kinds: kinds of the listed packages.
            may_manage: whether the visitor may change packages and settings.
        """
        catalogue = self.catalogue
        # Read first: if replies arrive during the search, the page then makes one more request.
        is_asking = catalogue.is_asking
        locks = self.factory.store.installed()
        hits = catalogue.hits(words, kinds)
        has = {lock.root: lock.version for lock in sorted(locks, key=lambda lock: lock.number)}
        job = self.jobs.newest
        return PackageList(
            repositories=catalogue.places,
            installed=tuple(self._installed(lock) for lock in locks if lock.key.kind in kinds),
            available=tuple(self._available(entry, has) for entry in hits[:MOST_HITS]),
            total=len(hits),
            is_asking=is_asking,
            may_manage=may_manage,
            job=job.news() if job is not None else None,
        )

    def _available(self, entry: IndexEntry, has: dict[str, str]) -> Available:
        versions = self.catalogue.versions(entry.key)
        return Available(
            package=str(entry.key),
            name=entry.name,
            kind=entry.kind,
            version=entry.version,
            versions=tuple(one.version for one in versions[:20]),
            summary=entry.summary,
            licence=entry.licence,
            authors=entry.authors,
            origin=self.catalogue.origin(entry),
            size=entry.size,
            has=has.get(str(entry.key), ""),
        )

    def _installed(self, lock: Lock) -> Installed:
        said, fault = None, ""
        try:
            said = self.factory.manifest(lock)
        except UrcError as error:
            fault = str(error)
        key, name = lock.key, lock.key.name
        is_served = self._packages.get(name) == lock
        page = f"/robots/{quote(name, safe='')}/"
        broken = self.fleet.broken.get(name) if is_served else None
        newest = next(iter(self.catalogue.versions(key)), None)
        is_old = newest is not None and newest.number > lock.number
        url = page if is_served else f"/widgets/{quote(name)}/" if key.kind == "widget" else ""
        return Installed(
            package=lock.root,
            name=name,
            kind=key.kind,
            version=lock.version,
            summary=said.summary if said else "",
            licence=said.licence if said else "",
            authors=said.authors if said else (),
            brings=tuple(
                f"{root} {pin.version}" for root, pin in lock.packages.items() if root != lock.root
            ),
            before=before.version if (before := self.factory.store.previous(lock)) else "",
            newer=newest.version if newest is not None and is_old else "",
            url=url,
            settings_url=f"{page}settings" if is_served else "",
            fits=self._fits(name) if key.kind == "interface" else (),
            fault=self._block_of(lock) or fault or (broken.fault if broken else ""),
            withdrawn=tuple(printable(spoken(line)) for line in self.catalogue.withdrawn(lock)),
        )

    def _block_of(self, lock: Lock) -> str:
        """Return why a package is blocked; "" if the package is not blocked."""
        try:
            return "; ".join(self.factory.store.blocked(lock))
        except UrcError as error:
            return str(error)

    def _fits(self, interface: str) -> tuple[str, ...]:
        """Return the titles of robots that offer an installed interface."""
        return tuple(
            robot.profile.title or name
            for name, robot in self.fleet.robots.items()
            if interface in robot.profile.interfaces
        )


def _all(locks: Iterable[Lock]) -> set[str]:
    return {f"{key} {pin.version}" for lock in locks for key, pin in lock.packages.items()}
