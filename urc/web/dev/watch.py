"""A watcher of one robot's documents, which switches to the new version when a document is saved.

Layer 5. If the new version has errors, the previous version keeps running, and the problems are
reported. A valid version waits until no operator drives the robot, because the switch briefly
disconnects it.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from urc.config.load import check
from urc.model.profile import Profile
from urc.problems import Problem, ProblemsError, UrcError, has_errors
from urc.runtime.document_tests import exercise
from urc.runtime.file_watch import PERIOD_S, FileWatcher
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of
from urc.web.fleet.robots import Robot, RobotService

__all__ = ["CheckedProfile", "ProfileWatch", "Remake", "examine"]

Remake = Callable[[Profile], Robot]
"""Function that creates a robot from a new version of its profile; may raise `UrcError`."""
State = Literal["running", "waiting", "broken"]

log = logging.getLogger(__name__)


class CheckedProfile(NamedTuple):
    """The result of `urc validate` for one file."""

    profile: Profile | None
    """The loaded profile; None if the file has errors."""
    problems: tuple[Problem, ...]
    files: tuple[str, ...]
    """Paths of all the profile's documents."""


def examine(file: str) -> CheckedProfile:
    """Check a document and run its tests."""
    checked = check(file, built_in_catalog(), widget_folder_of(file))
    problems = checked.problems
    if checked.profile is not None:
        problems = (*problems, *exercise(checked.profile).problems)
    return CheckedProfile(checked.profile, problems, checked.files)


@dataclass(slots=True)
class ProfileWatch:
    """A watcher of one robot's documents."""

    service: RobotService
    remake: Remake
    take: Callable[[Robot], None]
    """Function that switches the robot to another version; may raise `UrcError`."""
    state: State = "running"
    told: str = ""
    """Description of the last saved version and its outcome, for display."""
    problems: tuple[Problem, ...] = ()
    edition: int = 0
    """Number of changes to the state that developer pages show."""
    listeners: set[Callable[[], None]] = field(default_factory=set)
    _next: Profile | None = None
    _robot: Robot | None = None

    @property
    def robot(self) -> Robot:
        """The newest accepted version; the session of the previous version may still be closing."""
        return self._robot or self.service.robot

    @property
    def file(self) -> str:
        """Path of the robot's document."""
        return self.robot.profile.file

    async def run(self) -> None:
        """Watch until cancelled."""
        sleep = self.service.clock.sleep
        watched = FileWatcher([self.file])
        found = await asyncio.to_thread(examine, self.file)
        self.problems = found.problems
        self._report("running", "")
        while True:
            watched.add(found.files)
            while not watched.changed():
                self._try_switch()
                await sleep(PERIOD_S)
            await self._settled(watched)
            # Created before the files are read, so that no change is missed.
            watched = FileWatcher((self.file, *found.files))
            try:
                found = await asyncio.to_thread(examine, self.file)
                self._judge(found)
            except Exception as bug:  # a supervisor: the old version keeps running
                log.exception("%s could not be checked", self.file)
                self._report("broken", f"the check failed ({type(bug).__name__}: {bug})")

    async def _settled(self, watched: FileWatcher) -> None:
        """Wait until the files are stable; some programs write a file in several steps."""
        before: list[object] = []
        while (now := watched.states()) != before:
            before = now
            await self.service.clock.sleep(PERIOD_S)

    def _judge(self, found: CheckedProfile) -> None:
        self.problems = found.problems
        name = self.robot.profile.name
        if found.profile is None:
            self._next = None
            errors = [problem for problem in found.problems if problem.severity == "error"]
            if errors:
                log.warning("%s", ProblemsError(errors))
            self._report("broken", "cannot be used; the previous version keeps running")
        elif found.profile.name != name:
            self._next = None
            text = f"has the new name {found.profile.name!r}; {name!r} runs until URC restarts"
            self._report("broken", text)
        else:
            self._next = found.profile
            if not self._try_switch():
                text = "is valid; the switch waits until no operator drives and no stop is pending"
                self._report("waiting", text)

    def _try_switch(self) -> bool:
        """Try to switch a robot at rest to a pending version; return whether a switch was tried."""
        if self._next is None or not self.service.is_at_rest:
            return False
        profile, self._next = self._next, None
        try:
            robot = self.remake(profile)
            self.take(robot)
        except UrcError as error:
            self._report("broken", f"cannot be used: {error}; the previous version keeps running")
            return True
        self._robot = robot
        failed = " with problems" if has_errors(self.problems) else ""
        self._report("running", f"was saved and is now running{failed}")
        return True

    def _report(self, state: State, told: str) -> None:
        self.state, self.told = state, told
        self.edition += 1
        for wake in tuple(self.listeners):
            wake()
