"""URC from a Python script: the same profile, the same engine, no dashboard.

import asyncio
from urc import connect

async def main():
    async with connect("robots/puppet.yaml", port=6789) as robot:
        async for sample in robot.watch("battery"):
            print(sample.value)

asyncio.run(main())
"""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from os import PathLike
from pathlib import Path

from urc.model.profile import Profile
from urc.model.values import Reading, Sample, Value
from urc.problems import UrcError
from urc.runtime.catalog import built_in_catalog
from urc.runtime.session import CommandFailed, Session, resolve_settings

__all__ = ["CommandFailed", "ConnectedRobot", "connect", "load"]

log = logging.getLogger(__name__)


def load(path: str | PathLike[str]) -> Profile:
    """Return the profile in a file.

    Raises:
        ProblemsError: the document cannot be used; `problems` has every finding.
    """
    from urc.config.load import load_profile

    return load_profile(Path(path), built_in_catalog())


@asynccontextmanager
async def connect(
    profile: Profile | str | PathLike[str], **settings: Value
) -> AsyncIterator["ConnectedRobot"]:
    """Connect a robot for the length of the block; lost lines are connected again by themselves.

    Args:
        profile: as from `load`, or the path of its file.
        settings: by name, ``-`` written as ``_``; those left out take their defaults.

    Raises:
        UrcError: the profile cannot be used, or a setting is wrong or missing. A robot that cannot
            be reached is no error here: `command` says so, and `state` shows it.
    """
    opened = profile if isinstance(profile, Profile) else load(profile)
    given = {_setting_name(opened, name): _as_text(value) for name, value in settings.items()}
    values, missing = resolve_settings(opened, given)
    if missing:
        raise UrcError(f"{opened.name} needs a value for: {', '.join(missing)}")
    async with Session(opened, values, built_in_catalog().transports) as session:
        yield ConnectedRobot(session)
        if lost := await session.settle():
            log.warning("%s: %s", opened.name, lost)


class ConnectedRobot:
    """What a script needs of a connected robot; the whole `session` is there as well."""

    def __init__(self, session: Session) -> None:
        """Made by `connect`."""
        self.session = session

    async def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command and return the values of its reply; the wait is bounded.

        Raises:
            CommandFailed: with a `code` and a message.
        """
        replied = await self.session.command(name, arguments)
        return dict(replied.values)

    def latest(self, name: str) -> Sample | None:
        """Return the newest reading of a signal, or None when there was none yet.

        Raises:
            UrcError: the driver has no such signal.
        """
        self._check(name)
        return self.session.hub.latest(name)

    def state(self, transport: str) -> str:
        """Return ``idle``, ``connecting``, ``live``, ``silent`` or ``lost``.

        Raises:
            UrcError: the driver has no such transport.
        """
        if transport not in self.session.hub.links:
            known = ", ".join(self.session.hub.links)
            raise UrcError(f"there is no transport {transport!r}; there are: {known}")
        return self.session.hub.links[transport].state

    async def watch(self, *names: str) -> AsyncIterator[Sample]:
        """Yield readings as they change, of the signals named or of all, until you stop asking.

        The newest counts: a script that is slow skips readings, and is never behind.

        Raises:
            UrcError: the driver has no such signal.
        """
        for name in names:
            self._check(name)
        with self.session.hub.subscribe() as subscription:
            while True:
                for sample in subscription.take():
                    if not names or sample.signal in names:
                        yield sample
                await subscription.changed()

    def _check(self, name: str) -> None:
        if name not in self.session.hub.signals:
            known = ", ".join(self.session.hub.signals) or "none"
            raise UrcError(f"there is no signal {name!r}; there are: {known}")


def _setting_name(profile: Profile, name: str) -> str:
    dashed = name.replace("_", "-")
    return dashed if name not in profile.settings and dashed in profile.settings else name


def _as_text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
