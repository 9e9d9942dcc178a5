"""What the repositories have, as they said it last: asked in the background, read at once.

Floor 5. A page that is opened starts the asking and shows what was known; nobody waits for a
server that is switched off.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec

from urc.packages.index import Entry, search
from urc.packages.install import withdrawn_lines
from urc.packages.lock import Lock
from urc.packages.names import Key, PackageError, parse_key
from urc.packages.repositories import Repositories, Repository
from urc.web.daemon import in_daemon
from urc.web.manage.wire import Place

__all__ = ["FRESH_S", "Catalogue"]

FRESH_S: Final = 20.0
"""What was said so long ago is not asked again."""


class Catalogue:
    """The packages of all repositories that this user added."""

    def __init__(self, folder: Path, now: Callable[[], float]) -> None:
        """Ask nobody yet.

        Args:
            folder: of the packages; the list of repositories is in it.
            now: the time, in seconds.
        """
        self._folder = folder
        self._now = now
        self._asked_s: float | None = None
        self._asking: asyncio.Task[None] | None = None
        self.places: tuple[Place, ...] = ()
        self.found: dict[Key, list[tuple[Entry, str]]] = {}
        """Every version of every package, and the address of its repository."""
        self.fault = ""
        """Why the list of repositories itself cannot be read."""

    @property
    def is_asking(self) -> bool:
        """Whether answers are on their way."""
        return self._asking is not None and not self._asking.done()

    def repositories(self, complain: Callable[[str], None]) -> Repositories:
        """Return the list of repositories."""
        return Repositories(self._folder, complain)

    def ask(self, *, force: bool = False) -> None:
        """Begin to ask all repositories, unless that was done a moment ago."""
        is_fresh = self._asked_s is not None and self._now() - self._asked_s < FRESH_S
        if self.is_asking or (is_fresh and not force):
            return
        self._asking = asyncio.get_running_loop().create_task(self._ask())

    async def close(self) -> None:
        """Wait for nobody any more."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.wait((self._asking,), timeout=1)

    def entries(self) -> list[Entry]:
        """Return every version of every package."""
        return [entry for some in self.found.values() for entry, _ in some]

    def hits(self, words: str, kinds: tuple[str, ...]) -> list[Entry]:
        """Return the newest version of each package of some kinds that has all words."""
        entries = [entry for entry in self.entries() if entry.kind in kinds]
        return search(entries, words.split())

    def versions(self, key: Key) -> list[Entry]:
        """Return all versions of a package that are offered, the newest first."""
        some = [entry for entry, _ in self.found.get(key, ()) if not entry.why_withdrawn]
        return sorted(some, key=lambda entry: entry.number, reverse=True)

    def withdrawn(self, lock: Lock) -> list[str]:
        """Return for people what was withdrawn of an installed package, one line each."""
        keys = map(parse_key, lock.packages)
        return withdrawn_lines(lock, [one for key in keys for one, _ in self.found.get(key, ())])

    def origin(self, entry: Entry) -> str:
        """Return the address of the repository that has it."""
        return next((url for one, url in self.found.get(entry.key, ()) if one is entry), "")

    async def _ask(self) -> None:
        try:
            known = await asyncio.to_thread(self.repositories(_unheard).all)
            self.fault = ""
        except PackageError as error:
            self.fault = str(error)
            return
        answers = await asyncio.gather(
            *(in_daemon(lambda one=one: self._answer(one), f"ask {one.name}") for one in known)  # type: ignore[misc]
        )
        found: dict[Key, list[tuple[Entry, str]]] = {}
        for place, entries in reversed(answers):  # the first that has a package gives it
            fresh: dict[Key, list[tuple[Entry, str]]] = {}
            for entry in entries:
                fresh.setdefault(entry.key, []).append((entry, place.url))
            found |= fresh
        self.places, self.found = tuple(place for place, _ in answers), found
        self._asked_s = self._now()

    def _answer(self, repository: Repository) -> tuple[Place, tuple[Entry, ...]]:
        """Ask one repository, in a thread."""
        said: list[str] = []
        url, is_plain = repository.name, repository.name.startswith("http:")
        try:
            index = repository.refresh()
            place = Place(url, index.name, len(index.packages), "", False, is_plain)
            return msgspec.structs.replace(place, keeper=repository.keeper), index.packages
        except PackageError as error:
            said.append(str(error))
        try:
            entries = repository.entries()
        except PackageError:
            return Place(url, "", 0, said[0], False, is_plain), ()
        return Place(url, "", len(entries), said[0], True, is_plain), entries


def _unheard(_: str) -> None:
    """Let a complaint pass: it is told where the answer is."""
