"""Installation jobs; each consists of planning, review, approval and installation.

Layer 5. A job can be cancelled until the installation starts. No function in this module blocks the
event loop. Downloads run in a thread, which is abandoned if the job is cancelled. A job changes the
package store only at its end, in one step.
"""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc._daemon import in_daemon
from urc._translatable import phrase
from urc.packages.index import IndexEntry
from urc.packages.install import origin_lines, plan_file, plan_requirement
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import Lock
from urc.packages.names import PackageError, PackageId, PackageRequirement
from urc.packages.sources import FileSource, Source
from urc.packages.store import Store, kinds_in
from urc.packages.update import UpdateDiff, plan_update, staged_difference
from urc.problems import UrcError, printable
from urc.runtime.isolation import PreviewWorker
from urc.runtime.settings_store import DRIVEN
from urc.web.manage.upload_source import source_at
from urc.web.manage.wire import JobNews, JobState
from urc.web.words import spoken

__all__ = ["Busy", "Job", "Jobs", "Wanted"]

_WIRE_MOST: Final = 100
"""Maximum number of reported changes to the frames that are sent to the robot."""
_INSTALLING: Final = phrase("installing")
_LEFT_MOST: Final = 4
"""Maximum number of cancelled jobs' threads that may still be waiting for a server."""


Wanted = PackageRequirement | Path | FileSource | Lock
"""The source of a job: a package by name, a path on this machine, an upload, or the lock of a
package to update."""


class Busy(UrcError):
    """A job or a change is refused, because it is currently impossible."""


class _Planned(NamedTuple):
    plan: InstallPlan
    origins: tuple[str, ...]
    may: tuple[str, ...]
    risks: tuple[str, ...] = ()
    """Files, programs and hosts that the package uses without a setting, one per line."""
    unsigned: tuple[str, ...] = ()
    """Packages without the required signature, such as ``widgets/dial``."""
    old: Lock | None = None
    """Version replaced by the update; None for a new installation."""
    stays: Lock | None = None
    """Version that stays in use after another version is installed; None if no version stays in
    use."""
    changes: UpdateDiff | None = None


@dataclass
class Job:
    """One installation job, from the request to the result.

    The job's thread changes only the job's text and numbers.
    """

    number: int
    title: str
    state: JobState = "working"
    line: str = phrase("contacting the repositories")
    done: int = 0
    of: int = 0
    notes: list[str] = field(default_factory=list)
    planned: _Planned | None = None
    is_given_up: bool = False

    def news(self) -> JobNews:
        """Return the job's state for pages."""
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
            unsigned=_clean(planned.unsigned if planned is not None else ()),
            gained=_clean(changes.gained if changes is not None else ()),
            lost=_clean(changes.lost if changes is not None else ()),
            wire=_clean(changes.wire if changes is not None else ())[:_WIRE_MOST],
            stays=planned.stays.version if planned is not None and planned.stays else "",
            notes=_clean(dict.fromkeys(self.notes)),
        )


class _ReportingSource:
    """A package source that reports progress to a job and fails once the job is cancelled."""

    def __init__(self, source: Source, job: Job) -> None:
        self._source = source
        self._job = job

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    @property
    def name(self) -> str:
        return self._source.name

    def entries(self) -> tuple[IndexEntry, ...]:
        self._check()
        self._job.line = phrase("contacting {place}", place=self._source.name)
        return self._source.entries()

    def fetch(self, entry: IndexEntry) -> bytes:
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
    """Runs the installation jobs of one package store.

    Only one job runs at a time. The newest job stays visible on the pages after its end.
    """

    def __init__(
        self,
        store: Store,
        sources: Callable[[Callable[[str], None]], Sequence[Source]],
        used: Callable[[PackageId], Lock | None] = lambda _: None,
    ) -> None:
        """Start without a job.

        Args:
            store: the store of installed packages.
            sources: function that returns the repositories and reports warnings to its argument.
            used: function that returns the version in use of a package, or of another package with
                the same name.
        """
        self._store = store
        self._used = used
        self._sources = sources
        self._numbers = count(1)
        self._task: asyncio.Task[None] | None = None
        self._left = 0
        self.newest: Job | None = None

    def begin(self, what: Wanted) -> Job:
        """Start planning an installation; raise `Busy` while another job is working."""
        if self.newest is not None and self.newest.state == "working":
            raise Busy(f"{self.newest.title} is still in progress: wait for it, or cancel it")
        if self._left >= _LEFT_MOST:
            raise Busy("too many cancelled downloads are still open: try again in two minutes")
        title = what.name if isinstance(what, FileSource) else str(what)
        job = self.newest = Job(next(self._numbers), title)
        loop = asyncio.get_running_loop()
        self._task = loop.create_task(self._work(job, partial(self._plan, job, what)))
        return job

    def touched(self, number: int) -> tuple[PackageId | None, Lock | None]:
        """Return the package that a job installs and the version that must stay in use."""
        planned = self._asked(number).planned
        if planned is None:
            return None, None
        return planned.plan.lock.key, None if planned.old else self._used(planned.plan.lock.key)

    async def agree(
        self, number: int, *, takes_risks: bool = False, unsigned: Iterable[str] = ()
    ) -> Job:
        """Install the planned package, which the user has approved.

        Args:
            number: number of the job.
            takes_risks: whether the user also approved the files, programs and hosts that the
                package uses without a setting.
            unsigned: names of unsigned packages that the user accepts.

        Raises:
            Busy: the job is not waiting for approval.
            PackageError: the package needs `takes_risks`, or an unsigned package was not accepted.
        """
        job = self._asked(number)
        planned = job.planned
        if job.state != "asks" or planned is None:
            raise Busy("no job is waiting for approval: start a new job")
        if planned.risks and not takes_risks:
            raise PackageError(
                f"{planned.plan.lock} uses files, programs or hosts without a setting:"
                " approve them too"
            )
        plan = planned.plan._replace(waived=frozenset(unsigned))
        if lacks := [one for one in planned.unsigned if one not in plan.waived]:
            raise PackageError(
                f"{', '.join(lacks)}: not signed: approve each package by name, or cancel"
            )
        job.state, job.line = "working", _INSTALLING
        try:
            await asyncio.to_thread(self._install, planned._replace(plan=plan))
        except (UrcError, OSError) as error:
            job.state, job.line = "failed", _line(error)
        else:
            job.state = "done"
            job.line = phrase("installed {package}", package=planned.plan.lock)
        job.planned = planned._replace(plan=plan._replace(archives={}))
        return job

    async def planned(self) -> Job | None:
        """Wait until the newest job needs approval or has ended; return the job."""
        if self._task is not None:
            await asyncio.wait((self._task,))
        return self.newest

    def cancel(self, number: int) -> Job:
        """Cancel the job unless its installation has started; raise `Busy` for an earlier job."""
        job = self._asked(number)
        if job.state in ("working", "asks") and job.line != _INSTALLING:
            job.is_given_up = True
            job.state, job.planned = "cancelled", None
            job.line = phrase("Cancelled; nothing has changed")
            if self._task is not None:
                self._task.cancel()
        return job

    async def close(self) -> None:
        """Abandon all threads."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait((self._task,), timeout=1)

    def _asked(self, number: int) -> Job:
        if self.newest is None or self.newest.number != number:
            raise Busy("another page has started a newer job")
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
                job.state, job.line = "asks", phrase("permissions read")

    def _ended(self, thread: "asyncio.Future[_Planned]") -> None:
        self._left -= 1
        if not thread.cancelled():
            thread.exception()  # marks the exception as retrieved

    def _plan(self, job: Job, what: Wanted) -> _Planned:
        """Download all packages and read their permissions; called in a thread."""
        known = [_ReportingSource(one, job) for one in self._sources(job.notes.append)]
        plan = self._fetched(job, what, known)
        if job.is_given_up:
            raise PackageError("given up")
        job.of = job.done
        job.line = phrase("reading the permissions")
        old = what if isinstance(what, Lock) else None
        with self._store.changing() as change:
            unsigned = tuple(self._store.state().lacking(plan))
            # The preview needs the files before the user has given waivers.
            folder = change.stage(plan._replace(waived=frozenset(unsigned)))
            lock = plan.lock
            widgets = [key.name for key in kinds_in(lock, "widget")]
            document = folder / lock.root / f"{lock.key.kind}.yaml"
            look = PreviewWorker()
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
        return _Planned(plan, tuple(origins), may, tuple(risks), unsigned, old, stays, changes)

    def _changes(
        self, job: Job, before: Lock | None, plan: InstallPlan, folder: Path, look: PreviewWorker
    ) -> UpdateDiff | None:
        """Return the differences from the installed version; None if none can be determined."""
        if before is None:
            return None
        if before.key != plan.lock.key:
            job.notes.append(
                phrase(
                    "{package} stays in use under this name: remove it to use the new package",
                    package=before,
                )
            )
            return None
        try:
            return staged_difference(before, plan, self._store, folder, look)
        except UrcError as error:
            job.notes.append(
                phrase(
                    "the changes are unknown: {package} cannot be read: {why}",
                    package=before,
                    why=_line(error),
                )
            )
            return None

    def _fetched(self, job: Job, what: Wanted, known: Sequence[Source]) -> InstallPlan:
        if isinstance(what, (PackageRequirement, Lock)) and not known:
            raise PackageError("there is no repository: add one first")
        if isinstance(what, PackageRequirement):
            return plan_requirement(what, known, self._store, job.notes.append)
        if isinstance(what, Lock):
            plan = plan_update(what, known, self._store, job.notes.append)
            if plan is None:
                raise PackageError(f"{what} is already the newest version")
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
    """Return the first problem of a failure as one line of text."""
    text = str(error).strip().splitlines()
    return text[0] if text else type(error).__name__
