"""The one install that may be under way: planned, read, agreed to, done; or given up at any moment.

Floor 5. Nothing here holds up the loop: fetching is done in a thread that is not waited for when
somebody gives up, and the store changes in one step at the end.
"""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc._phrases import phrase
from urc.packages.index import Entry
from urc.packages.install import origin_lines, plan_file, plan_wish
from urc.packages.lock import Lock
from urc.packages.names import Key, PackageError, Wish
from urc.packages.plan import Plan
from urc.packages.sources import FileSource, Source
from urc.packages.store import Store, kinds_in
from urc.packages.update import Difference, plan_update, staged_difference
from urc.problems import UrcError, printable
from urc.runtime.apart import Looks
from urc.runtime.kept import DRIVEN
from urc.web.daemon import in_daemon
from urc.web.manage.given import source_at
from urc.web.manage.wire import JobNews, JobState
from urc.web.words import spoken

__all__ = ["Busy", "Job", "Jobs", "Wanted"]

_WIRE_MOST: Final = 100
"""Lines of what changes on the wire that are told."""
_INSTALLING: Final = phrase("installing")
_LEFT_MOST: Final = 4
"""Threads that may still hang at a server after somebody gave up."""


Wanted = Wish | Path | FileSource | Lock
"""A package by name, a place on this machine, what was handed over, or an update of a lock."""


class Busy(UrcError):
    """Another job is under way."""


class _Planned(NamedTuple):
    plan: Plan
    origins: tuple[str, ...]
    may: tuple[str, ...]
    risks: tuple[str, ...] = ()
    """What of this machine it uses by itself."""
    old: Lock | None = None
    """What an update takes the place of."""
    stays: Lock | None = None
    """What is in use, and stays so: another version is installed beside it."""
    changes: Difference | None = None


@dataclass
class Job:
    """One install, from the wish to its end. Its thread only writes words and numbers."""

    number: int
    title: str
    state: JobState = "working"
    line: str = phrase("asking the repositories")
    done: int = 0
    of: int = 0
    notes: list[str] = field(default_factory=list)
    planned: _Planned | None = None
    is_given_up: bool = False

    def news(self) -> JobNews:
        """Return what pages are told."""
        planned = self.planned
        changes = planned.changes if planned is not None else None
        packages = planned.origins if planned is not None else ()
        return JobNews(
            self.number,
            self.title,
            self.state,
            printable(spoken(self.line)),
            self.done,
            self.of,
            is_update=changes is not None,
            packages=_clean(changes.versions if changes is not None else packages),
            may=_clean(planned.may if planned is not None else ()),
            risks=_clean(planned.risks if planned is not None else ()),
            gained=_clean(changes.gained if changes is not None else ()),
            lost=_clean(changes.lost if changes is not None else ()),
            wire=_clean(changes.wire if changes is not None else ())[:_WIRE_MOST],
            stays=planned.stays.version if planned is not None and planned.stays else "",
            notes=_clean(dict.fromkeys(self.notes)),
        )


class _Watched:
    """A source that tells a job what it fetches, and stops when the job is given up."""

    def __init__(self, source: Source, job: Job) -> None:
        self._source = source
        self._job = job

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    @property
    def name(self) -> str:
        return self._source.name

    def entries(self) -> tuple[Entry, ...]:
        self._check()
        self._job.line = phrase("asking {place}", place=self._source.name)
        return self._source.entries()

    def fetch(self, entry: Entry) -> bytes:
        self._check()
        self._job.done += 1
        self._job.line = phrase("fetching {package} ({size} bytes)", package=entry, size=entry.size)
        data = self._source.fetch(entry)
        self._check()
        return data

    def _check(self) -> None:
        if self._job.is_given_up:
            raise PackageError("given up")


class Jobs:
    """The jobs of one store: one at a time, and the newest stays to be looked at."""

    def __init__(
        self,
        store: Store,
        sources: Callable[[Callable[[str], None]], Sequence[Source]],
        used: Callable[[Key], Lock | None] = lambda _: None,
    ) -> None:
        """Do nothing yet.

        Args:
            store: what is changed.
            sources: returns the repositories, whose complaints go to what is given.
            used: returns what is in use of a package, or under its name.
        """
        self._store = store
        self._used = used
        self._sources = sources
        self._numbers = count(1)
        self._task: asyncio.Task[None] | None = None
        self._left = 0
        self.newest: Job | None = None

    def begin(self, what: Wanted) -> Job:
        """Plan what somebody asks for; raise `Busy` while another one is at work."""
        if self.newest is not None and self.newest.state == "working":
            raise Busy(f"{self.newest.title} is under way: wait for it, or give it up")
        if self._left >= _LEFT_MOST:
            raise Busy("too many servers that were given up still hang: try again in two minutes")
        title = what.name if isinstance(what, FileSource) else str(what)
        job = self.newest = Job(next(self._numbers), title)
        loop = asyncio.get_running_loop()
        self._task = loop.create_task(self._work(job, partial(self._plan, job, what)))
        return job

    def touched(self, number: int) -> tuple[Key | None, Lock | None]:
        """Return which package a job installs, and what is in use and must stay so."""
        planned = self._asked(number).planned
        if planned is None:
            return None, None
        return planned.plan.lock.key, None if planned.old else self._used(planned.plan.lock.key)

    async def agree(self, number: int, *, takes_risks: bool = False) -> Job:
        """Install what a job has planned; raise `Busy` when it does not ask.

        Args:
            number: of the job.
            takes_risks: whether what the package uses by itself was agreed to as well.

        Raises:
            PackageError: it was not.
        """
        job = self._asked(number)
        planned = job.planned
        if job.state != "asks" or planned is None:
            raise Busy("there is nothing to agree to: begin again")
        if planned.risks and not takes_risks:
            raise PackageError(
                f"{planned.plan.lock} uses something of this machine by itself: agree to that, too"
            )
        job.state, job.line = "working", _INSTALLING
        try:
            await asyncio.to_thread(self._install, planned)
        except (UrcError, OSError) as error:
            job.state, job.line = "failed", _line(error)
        else:
            job.state = "done"
            job.line = phrase("installed {package}", package=planned.plan.lock)
        job.planned = planned._replace(plan=planned.plan._replace(archives={}))
        return job

    async def planned(self) -> Job | None:
        """Wait until the newest job asks, or has ended; return it."""
        if self._task is not None:
            await asyncio.wait((self._task,))
        return self.newest

    def give_up(self, number: int) -> Job:
        """End a job that has changed nothing yet; raise `Busy` when it is another one."""
        job = self._asked(number)
        if job.state in ("working", "asks") and job.line != _INSTALLING:
            job.is_given_up = True
            job.state, job.planned = "cancelled", None
            job.line = phrase("given up; nothing has changed")
            if self._task is not None:
                self._task.cancel()
        return job

    async def close(self) -> None:
        """Wait for nobody any more."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait((self._task,), timeout=1)

    def _asked(self, number: int) -> Job:
        if self.newest is None or self.newest.number != number:
            raise Busy("another page has begun something else meanwhile")
        return self.newest

    async def _work(self, job: Job, plan: Callable[[], _Planned]) -> None:
        thread = in_daemon(plan, f"plan {job.number}")
        self._left += 1
        thread.add_done_callback(self._ended)
        try:
            job.planned = await asyncio.shield(thread)
        except (UrcError, OSError) as error:
            if not job.is_given_up:
                job.state, job.line = "failed", _line(error)
        else:
            if not job.is_given_up:
                job.state, job.line = "asks", phrase("read what it may do")

    def _ended(self, thread: "asyncio.Future[_Planned]") -> None:
        self._left -= 1
        if not thread.cancelled():
            thread.exception()  # nobody may be waiting any more: that is no error

    def _plan(self, job: Job, what: Wanted) -> _Planned:
        """Fetch everything and read what it may do; in a thread."""
        known = [_Watched(one, job) for one in self._sources(job.notes.append)]
        plan = self._fetched(job, what, known)
        if job.is_given_up:
            raise PackageError("given up")
        job.of = job.done
        job.line = phrase("reading what it may do")
        old = what if isinstance(what, Lock) else None
        with self._store.changing() as change:
            folder = change.stage(plan)
            lock = plan.lock
            widgets = [key.name for key in kinds_in(lock, "widget")]
            document = folder / lock.root / f"{lock.key.kind}.yaml"
            look = Looks()
            seen = look(document, folder, widgets)
            before, stays = old, None
            used = self._used(lock.key)
            if old is None and used is not None and used != lock:
                is_chosen = used.key == lock.key and used.key.kind in DRIVEN
                stays = used if is_chosen and used.version != lock.version else None
                before = used
            changes = self._changes(job, before, plan, folder, look)
        origins = origin_lines(plan, self._store)
        risks = seen.risks if changes is None else changes.risks
        may = tuple(seen.permissions)
        return _Planned(plan, tuple(origins), may, tuple(risks), old, stays, changes)

    def _changes(
        self, job: Job, before: Lock | None, plan: Plan, folder: Path, look: Looks
    ) -> Difference | None:
        """Return what is another thing than in the version before, where that can be told."""
        if before is None:
            return None
        if before.key != plan.lock.key:
            job.notes.append(
                phrase(
                    "{package} stays in use under this name: remove it to use the other one",
                    package=before,
                )
            )
            return None
        try:
            return staged_difference(before, plan, self._store, folder, look)
        except UrcError as error:
            job.notes.append(
                phrase(
                    "what changes is not known: {package} cannot be read: {why}",
                    package=before,
                    why=_line(error),
                )
            )
            return None

    def _fetched(self, job: Job, what: Wanted, known: Sequence[Source]) -> Plan:
        if isinstance(what, (Wish, Lock)) and not known:
            raise PackageError("no repository is known: connect to one first")
        if isinstance(what, Wish):
            return plan_wish(what, known, self._store, job.notes.append)
        if isinstance(what, Lock):
            plan = plan_update(what, known, self._store, job.notes.append)
            if plan is None:
                raise PackageError(f"{what} is the newest there is")
            return plan
        source = what if isinstance(what, FileSource) else self._source_at(what)
        return plan_file(source, known, self._store, job.notes.append)

    def _source_at(self, path: Path) -> FileSource:
        return source_at(path, self._store.installed())

    def _install(self, planned: _Planned) -> None:
        with self._store.changing() as change:
            change.stage(planned.plan)
            if planned.old is None:
                change.commit(planned.plan)
            else:
                change.replace(planned.old, planned.plan)


def _clean(lines: Iterable[str]) -> tuple[str, ...]:
    return tuple(printable(spoken(line)) for line in lines)


def _line(error: Exception) -> str:
    """Return a failure in one line: of several findings the first."""
    text = str(error).strip().splitlines()
    return text[0] if text else type(error).__name__
