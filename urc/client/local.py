"""Opens a robot in this process, with the same profile and engine as the dashboard.

    import asyncio
    from urc import connect

    async def main():
        async with connect("robots/puppet.yaml", port=6789) as robot:
            async for sample in robot.watch("battery"):
                print(sample.value)

    asyncio.run(main())

Layer 5. Lost connections are reopened. A guard process sends all motion to the robot, and stops the
robot if this process hangs or dies.
"""

import logging
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from os import PathLike
from pathlib import Path

from urc._folders import data_folder
from urc.client.local_motion import LocalMotion
from urc.client.readings import HubReadings
from urc.client.stick import VALID_S, Stick
from urc.model.profile import Profile
from urc.model.values import Reading, Value
from urc.problems import UrcError
from urc.runtime.command_failed import CommandFailed
from urc.runtime.motion_interlock import MotionInterlock
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session, resolve_settings

__all__ = ["CommandFailed", "ConnectedRobot", "connect", "load"]

log = logging.getLogger(__name__)


def load(path: str | PathLike[str]) -> Profile:
    """Load a file and return its profile.

    Raises:
        ProblemsError: the document has errors; `problems` lists them.
    """
    from urc.config.load import load_profile

    return load_profile(Path(path), built_in_catalog())


@asynccontextmanager
async def connect(
    profile: Profile | str | PathLike[str], **settings: Value
) -> AsyncIterator["ConnectedRobot"]:
    """Connect to a robot while the context is open; lost connections are reopened.

    Args:
        profile: profile returned by `load`, or path of a file.
        settings: values by name, with ``_`` instead of ``-``; missing settings use their defaults.

    Raises:
        UrcError: the profile has errors, or a setting is wrong or missing. An unreachable robot
            raises no error in `connect`; `command` and `state` report the failure.
    """
    opened = profile if isinstance(profile, Profile) else load(profile)
    given = {_setting_name(opened, name): _as_text(value) for name, value in settings.items()}
    values, missing = resolve_settings(opened, given)
    if missing:
        raise UrcError(f"{opened.name} needs a value for: {', '.join(missing)}")
    interlock = MotionInterlock(data_folder(), opened.name)
    async with Session(opened, values, built_in_catalog().transports, motion="guarded") as session:
        robot = ConnectedRobot(session)
        async with robot.motion.running(interlock):
            yield robot
            if lost := await session.settle():
                log.warning("%s: %s", opened.name, lost)


class ConnectedRobot(HubReadings):
    """A robot that this process is connected to; see `urc.client.robot.RobotInterface`.

    The attribute `session` provides all other functions.
    """

    def __init__(self, session: Session) -> None:
        """Store the session; scripts call `connect` instead of using this constructor."""
        super().__init__(session.hub)
        self.session = session
        self.motion = LocalMotion(session)
        """The object that takes and releases the robot's controls for this process."""

    @property
    def name(self) -> str:
        """Name of the robot's profile."""
        return self.session.profile.name

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the held commands, which `drive` accepts."""
        return self.motion.controls

    @property
    def operator(self) -> str:
        """Name of the program that has the controls in this process; "" if they are free."""
        holder = self.motion.controller.lease.state.holder
        return holder.name if holder is not None else ""

    @property
    def latched_by(self) -> str:
        """Name of the person or program that latched STOP; "" while STOP is not latched."""
        return self.motion.controller.lease.state.latched_by

    async def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command, and return the values in its reply; the wait has a time limit.

        Raises:
            CommandFailed: the command failed; the exception has a `code` and a message.
        """
        people = self.motion.admit(name, arguments)
        replied = await self.session.command(name, arguments, confirmed_by=people)
        return dict(replied.values)

    def drive(
        self, command: str = "", /, *, valid_s: float = VALID_S
    ) -> AbstractAsyncContextManager[Stick]:
        """Take the controls while the context is open; see `urc.client.robot.RobotInterface`."""
        return self.motion.drive(command, valid_s)

    async def stop(self) -> bool:
        """Stop the robot, and latch STOP in this process.

        Returns:
            Whether all of the robot's connections accepted the stop within two seconds.

        Raises:
            UrcError: the robot has no motion to stop.
        """
        return await self.motion.stop()

    async def reset(self) -> None:
        """Reset this process's STOP; the robot does not move before new input.

        Raises:
            CommandFailed: the reset was refused.
        """
        self.motion.reset()


def _setting_name(profile: Profile, name: str) -> str:
    dashed = name.replace("_", "-")
    return dashed if name not in profile.settings and dashed in profile.settings else name


def _as_text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
