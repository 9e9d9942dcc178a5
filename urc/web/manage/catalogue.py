"""The package lists of the repositories, kept in memory and refreshed in the background.

Layer 5. Pages start a refresh but show the last known lists immediately, so they never wait for an
unreachable server.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec

from urc._daemon import in_daemon
from urc.packages.index import IndexEntry, search
from urc.packages.install import withdrawn_lines
from urc.packages.lock import Lock
from urc.packages.names import PackageError, PackageId, parse_key
from urc.packages.repositories import Repositories, Repository
from urc.web.manage.wire import RepositoryInfo

__all__ = ["FRESH_S", "PackageCatalog"]

FRESH_S: Final = 20.0
"""Minimum age of a package list before a refresh, in seconds."""


class PackageCatalog:
    """The packages of all repositories added by the user."""

    def __init__(self, folder: Path, now: Callable[[], float]) -> None:
        """Prepare the lists without contacting any repository.

        Args:
            folder: folder with the packages and the list of repositories.
            now: function that returns the current time, in seconds.
        """
        self._folder = folder
        self._now = now
        self._asked_s: float | None = None
        self._asking: asyncio.Task[None] | None = None
        self.places: tuple[RepositoryInfo, ...] = ()
        self.found: dict[PackageId, list[tuple[IndexEntry, str]]] = {}
        """Every version of every package, with the URL of the repository that offers it."""
        self.fault = ""
        """Reason why the list of repositories cannot be read; "" if it can."""

    @property
    def is_asking(self) -> bool:
        """Whether a refresh is running."""
        return self._asking is not None and not self._asking.done()

    def repositories(self, complain: Callable[[str], None]) -> Repositories:
        """Return the list of repositories."""
        return Repositories(self._folder, complain)

    def refresh(self, *, force: bool = False) -> None:
        """Start a refresh from all repositories, unless the last ended less than `FRESH_S` ago."""
        is_fresh = self._asked_s is not None and self._now() - self._asked_s < FRESH_S
        if self.is_asking or (is_fresh and not force):
            return
        self._asking = asyncio.get_running_loop().create_task(self._refresh())

    async def close(self) -> None:
        """Abandon pending requests."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.wait((self._asking,), timeout=1)

    def entries(self) -> list[IndexEntry]:
        """Return every version of every package."""
        return [entry for some in self.found.values() for entry, _ in some]

    def hits(self, words: str, kinds: tuple[str, ...]) -> list[IndexEntry]:
        """Return the newest version of each package that has a given kind and matches all words."""
        entries = [entry for entry in self.entries() if entry.kind in kinds]
        return search(entries, words.split())

    def versions(self, key: PackageId) -> list[IndexEntry]:
        """Return all versions of a package except withdrawn versions, newest first."""
        some = [entry for entry, _ in self.found.get(key, ()) if not entry.why_withdrawn]
        return sorted(some, key=lambda entry: entry.number, reverse=True)

    def withdrawn(self, lock: Lock) -> list[str]:
        """Return one line for each withdrawn package in an installed package's lock file."""
        keys = map(parse_key, lock.packages)
        return withdrawn_lines(lock, [one for key in keys for one, _ in self.found.get(key, ())])

    def origin(self, entry: IndexEntry) -> str:
        """Return the URL of the repository that offers an entry; "" if unknown."""
        return next((url for one, url in self.found.get(entry.key, ()) if one is entry), "")

    async def _refresh(self) -> None:
        try:
            known = await asyncio.to_thread(self.repositories(_unheard).all)
            self.fault = ""
        except PackageError as error:
            self.fault = str(error)
            return
        answers = await asyncio.gather(
            *(in_daemon(lambda one=one: self._answer(one), f"ask {one.name}") for one in known)  # type: ignore[misc]
        )
        found: dict[PackageId, list[tuple[IndexEntry, str]]] = {}
        for place, entries in reversed(answers):  # the first repository takes precedence
            fresh: dict[PackageId, list[tuple[IndexEntry, str]]] = {}
            for entry in entries:
                fresh.setdefault(entry.key, []).append((entry, place.url))
            found |= fresh
        self.places, self.found = tuple(place for place, _ in answers), found
        self._asked_s = self._now()

    def _answer(self, repository: Repository) -> tuple[RepositoryInfo, tuple[IndexEntry, ...]]:
        """Request the package list of one repository; called in a thread."""
        said: list[str] = []
        url, is_plain = repository.name, repository.name.startswith("http:")
        try:
            index = repository.refresh()
            place = RepositoryInfo(url, index.name, len(index.packages), "", False, is_plain)
            return msgspec.structs.replace(place, keeper=repository.keeper), index.packages
        except PackageError as error:
            said.append(str(error))
        try:
            entries = repository.entries()
        except PackageError:
            return RepositoryInfo(url, "", 0, said[0], False, is_plain), ()
        return RepositoryInfo(url, "", len(entries), said[0], True, is_plain), entries


def _unheard(_: str) -> None:
    """Ignore a warning, because the result of the request contains the same text."""
