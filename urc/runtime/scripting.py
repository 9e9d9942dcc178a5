"""Python scripting: the same profile and engine as the dashboard, without a dashboard.

    import asyncio
    from urc import connect

    async def main():
        async with connect("robots/puppet.yaml", port=6789) as robot:
            async for sample in robot.watch("battery"):
                print(sample.value)

    asyncio.run(main())

Lost connections are reopened.
"""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from os import PathLike
from pathlib import Path

from urc.model.profile import Profile
from urc.model.values import Reading, Sample, Value
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session, resolve_settings

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
    """Connect a robot while the context is open; lost connections are reopened.

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
    async with Session(opened, values, built_in_catalog().transports) as session:
        yield ConnectedRobot(session)
        if lost := await session.settle():
            log.warning("%s: %s", opened.name, lost)


class ConnectedRobot:
    """A connected robot for scripts; the attribute `session` offers all other functions."""

    def __init__(self, session: Session) -> None:
        """Store the session; scripts call `connect` instead of this constructor."""
        self.session = session

    async def command(self, name: str, /, **arguments: Reading) -> dict[str, Reading]:
        """Run a command and return the values of its reply; the wait has a time limit.

        Raises:
            CommandFailed: the command failed; the exception has a `code` and a message.
        """
        replied = await self.session.command(name, arguments)
        return dict(replied.values)

    def latest(self, name: str) -> Sample | None:
        """Return the newest reading of a signal, or None.

        Raises:
            UrcError: the driver has no signal of this name.
        """
        self._check(name)
        return self.session.hub.latest(name)

    def state(self, transport: str) -> str:
        """Return ``idle``, ``connecting``, ``live``, ``silent`` or ``lost``.

        Raises:
            UrcError: the driver has no transport of this name.
        """
        if transport not in self.session.hub.links:
            known = ", ".join(self.session.hub.links)
            raise UrcError(f"unknown transport {transport!r}; expected one of: {known}")
        return self.session.hub.links[transport].state

    async def watch(self, *names: str) -> AsyncIterator[Sample]:
        """Yield new readings of the named signals, or of all signals, until the caller stops.

        Only the newest reading is kept, so a slow script skips readings and never falls behind.

        Raises:
            UrcError: the driver has no signal of this name.
        """
        for name in names:
            self._check(name)
        with self.session.hub.subscribe() as subscription:
            while True:
                for sample in subscription.changes():
                    if not names or sample.signal in names:
                        yield sample
                await subscription.changed()

    def _check(self, name: str) -> None:
        if name not in self.session.hub.signals:
            known = ", ".join(self.session.hub.signals) or "none"
            raise UrcError(f"unknown signal {name!r}; expected one of: {known}")


def _setting_name(profile: Profile, name: str) -> str:
    dashed = name.replace("_", "-")
    return dashed if name not in profile.settings and dashed in profile.settings else name


def _as_text(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
