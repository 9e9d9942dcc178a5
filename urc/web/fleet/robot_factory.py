"""A factory that creates a dashboard's robots from documents, settings and installed packages.

Layer 5. The factory reads files and stores settings, but opens no sessions for served robots.
Reading files takes time, so the factory is called in a thread.
"""

import logging
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from urc.config.interface_fit import InterfaceFit, fit_interface
from urc.model.profile import Profile
from urc.model.values import Value
from urc.packages.lock import Lock
from urc.packages.manifest import Manifest
from urc.packages.names import PackageError
from urc.packages.package import open_package
from urc.packages.store import Store
from urc.problems import UrcError
from urc.runtime.destination import destination_of
from urc.runtime.local_hosts import check_hosts
from urc.runtime.open_profile import open_document
from urc.runtime.session import Session
from urc.runtime.settings import parse_setting
from urc.runtime.settings_store import DRIVEN, SettingsStore, StoredSettings, in_use
from urc.runtime.widget_registry import widget_folder_of
from urc.web.fleet.robots import Robot

__all__ = ["InstalledInterface", "ResolvedSettings", "RobotFactory", "RobotOptions"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """Options of the robot factory, set when the dashboard starts."""

    data: Path
    """Folder for the settings and packages."""
    make: Callable[[Profile, Mapping[str, Value]], Robot]
    """Function that creates a robot from a profile with the given settings."""
    tried: Callable[[Profile, Mapping[str, Value]], AbstractAsyncContextManager[Session]]
    """Function that opens a session to test the transports, without controlling the robot."""
    given: Callable[[Profile], Mapping[str, Value]]
    """Function that returns the settings given when the server started, which override stored
    settings. The function raises `UrcError` if given settings no longer fit the profile."""
    shows_installed: bool = False
    """Whether the menu lists the installed robots and drivers."""
    monitors: bool = False
    """Whether robots stay connected by default, so that their alarms are monitored."""


class ResolvedSettings(NamedTuple):
    """The resolved settings of a robot."""

    values: dict[str, Value]
    """Values of all usable settings, keyed by setting name."""
    given: dict[str, Value]
    """Values given when the server started, keyed by setting name."""
    destination: str
    """Hosts and ports of the robot's transports, to which secrets are tied."""
    withheld: frozenset[str]
    """Names of the secrets that were entered for another destination."""


class InstalledInterface(NamedTuple):
    """An installed interface."""

    lock: Lock
    document: str


class RobotFactory:
    """A factory that creates robots from documents."""

    def __init__(self, robot_options: RobotOptions) -> None:
        """List the installed packages, without reading their documents."""
        self.robot_options = robot_options
        self.store = Store(robot_options.data / "packages")
        self._there = self._roots()
        """Packages that were installed when the server started."""
        self._begun: dict[str, str] = {}
        """First destination of each robot, keyed by package or robot name. Settings given when the
        server started are valid only for that destination."""
        self._manifests: dict[tuple[str, int, int], Manifest] = {}
        """Cached manifests, keyed by the digest and the state of the archive; pages often need all
        manifests."""

    def _roots(self) -> frozenset[str]:
        try:
            return frozenset(lock.root for lock in self.store.installed())
        except PackageError:  # the manager pages report the error
            return frozenset()

    def stamp(self) -> object:
        """Return a value that changes when a package is installed or removed."""
        try:
            found = (self.store.folder / "state.json").stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino

    def settings_store(self, name: str) -> SettingsStore:
        """Return the store of a robot's settings."""
        return SettingsStore(self.robot_options.data / "robots", name)

    def robot(self, name: str, profile: Profile, kept: StoredSettings | None = None) -> Robot:
        """Return a robot with its settings and all suitable interfaces, or raise `UrcError`.

        Args:
            name: the robot's name in URLs.
            profile: the robot's profile, without added interfaces.
            kept: the robot's stored settings; None to read them from the file.
        """
        chosen = self.settings_store(name).load() if kept is None else kept
        filled = self.resolved_settings(profile, chosen)
        for secret in sorted(filled.withheld):
            log.warning(
                "%s: the setting %s was entered for another destination, package or version of URC:"
                " enter it again",
                name,
                secret,
            )
        complete = self.with_interfaces(profile, chosen.interface)
        made = self.robot_options.make(complete, filled.values)
        choice = chosen.monitors_alarms
        is_monitored = self.robot_options.monitors if choice is None else choice
        return replace(made, is_monitored=is_monitored) if is_monitored else made

    def resolved_settings(self, profile: Profile, kept: StoredSettings) -> ResolvedSettings:
        """Return the resolved settings of a robot, or raise `UrcError`.

        A value given when the server started overrides a stored value, and a stored value overrides
        the default. A stored value that has become invalid, for example after an update, counts as
        missing. A secret is used only for the destination for which it was entered.
        """
        defaults: dict[str, Value] = {
            name: setting.default
            for name, setting in profile.settings.items()
            if setting.default is not None
        }
        typed = dict(defaults)
        for name, text in kept.settings.items():
            if name in profile.settings:
                try:
                    typed[name] = parse_setting(profile.settings[name], text)
                except UrcError:
                    typed.pop(name, None)
        given = dict(self.robot_options.given(profile))
        package = self.package_of(profile)
        everything = typed | given
        place = destination_of(profile, package, everything)
        begun = self._begun_at(profile, package, defaults | given)
        withheld: set[str] = set()
        for name, setting in profile.settings.items():
            if not setting.is_secret or name not in everything:
                continue
            if name in given and begun == place:
                continue
            given.pop(name, None)
            if name in typed and kept.destination == place:
                everything[name] = typed[name]
            else:
                del everything[name]
                withheld.add(name)
        for name, setting in profile.settings.items():
            if not setting.is_required:
                everything.setdefault(name, setting.empty)
        return ResolvedSettings(everything, given, place, frozenset(withheld))

    def _begun_at(self, profile: Profile, package: str, values: Mapping[str, Value]) -> str:
        """Return the robot's destination at the server's start; "" for a robot installed later."""
        if package and package not in self._there:
            return ""
        place = destination_of(profile, package, values)
        return self._begun.setdefault(package or profile.name, place)

    def package_of(self, profile: Profile) -> str:
        """Return a robot's installed package, such as ``drivers/puppet``; "" for other robots."""
        home = (self.store.folder / "ecosystems").resolve()
        try:
            parts = Path(profile.file).resolve().relative_to(home).parts
        except ValueError:
            return ""
        return "/".join(parts[1:3])

    def with_interfaces(self, profile: Profile, first: str = "") -> Profile:
        """Return the profile with all suitable installed interfaces, beginning with `first`."""
        interfaces, widgets = dict(profile.interfaces), dict(profile.widgets)
        for added in self.interfaces():
            found = self.fit(added, profile)
            if found.interface is not None and added.lock.key.name not in interfaces:
                interfaces[added.lock.key.name] = found.interface._replace(name=added.lock.key.name)
                widgets |= found.widgets
        if first in interfaces:
            interfaces = {first: interfaces[first], **interfaces}
        return profile._replace(interfaces=interfaces, widgets=widgets)

    def fit(self, added: InstalledInterface, profile: Profile) -> InterfaceFit:
        """Return an installed interface, bound to a robot's signals and commands."""
        if added.lock.key.name in profile.interfaces:
            return InterfaceFit(None, fault="this robot already has an interface with this name")
        return fit_interface(added.document, profile, widget_folder_of(added.document))

    def interfaces(self) -> list[InstalledInterface]:
        """Return the newest version of each directly installed interface."""
        newest = {lock.root: lock for lock in _ascending(self.store.installed())}
        found = []
        for lock in newest.values():
            if lock.key.kind == "interface":
                try:
                    found.append(InstalledInterface(lock, str(self.store.document(lock))))
                except PackageError:
                    continue  # damaged: the list of installed packages shows it
        return found

    def installed_robots(self) -> dict[str, list[Lock]]:
        """Return the versions of each installed package with a robot, keyed by package name.

        Versions are in ascending order. If a robot package and a driver package have the same
        name, the result contains only the package in use.
        """
        locks = self.store.installed()
        found: dict[str, list[Lock]] = {}
        for name in {lock.key.name for lock in locks if lock.key.kind in DRIVEN}:
            used = in_use(self.robot_options.data / "robots", name, locks)
            found[name] = [one for one in _ascending(locks) if used and one.key == used.key]
        return dict(sorted(found.items()))

    def chosen_version(self, locks: list[Lock], version: str) -> Lock:
        """Return the chosen version of a robot's package; by default, the newest version."""
        return next((lock for lock in locks if lock.version == version), locks[-1])

    def profile(self, lock: Lock) -> Profile:
        """Return the profile of an installed package, or raise `UrcError`."""
        profile = open_document(self.store.document(lock))
        check_hosts(profile)
        return profile

    def reload(self, profile: Profile) -> Profile:
        """Reread the profile of a robot given when the server started, or raise `UrcError`."""
        return open_document(profile.file)

    def manifest(self, lock: Lock) -> Manifest:
        """Return the manifest of an installed package, or raise `UrcError`."""
        digest = lock.packages[lock.root].sha256
        try:
            found = self.store.blob_file(digest).stat()
            key = digest, found.st_mtime_ns, found.st_size
        except OSError:
            key = digest, 0, 0
        if key not in self._manifests:
            said = open_package(self.store.blob(digest), str(lock)).manifest
            self._manifests = {**self._manifests, key: said}
        return self._manifests[key]


def _ascending(locks: tuple[Lock, ...]) -> list[Lock]:
    return sorted(locks, key=lambda lock: (lock.root, lock.number))
