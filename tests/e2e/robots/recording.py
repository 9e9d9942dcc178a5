"""A robot that ships, emulated behind real sockets, served as a dashboard, and overheard.

What reached the emulated robot is noted where its side of each line takes it: behind the socket,
before anything of URC's has looked at it.
"""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.dashboards import WAIT_S
from urc.config.load import load_profile
from urc.model.payload import Envelope, Payload
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.document_tests import sample_settings
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Motion, Session
from urc.simulator.emulated_profile import stand_in
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app, serve

__all__ = ["FOLDER", "Overheard", "alive"]

FOLDER = Path(__file__).parents[3] / "robots"
LONGEST_LEASE_S = 1.0
"""Longest lease of a document."""


class Overheard:
    """What came to the emulated robot, line by line."""

    def __init__(self, profile: Profile) -> None:
        self.profile = profile
        self.address = ""
        """Of the dashboard."""
        self.sessions = 0
        """How many connections of URC to the robot there are."""
        self._heard: dict[str, list[Payload]] = {}

    def mark(self) -> Mapping[str, int]:
        """Return how much there is by now."""
        return {name: len(pieces) for name, pieces in self._heard.items()}

    def bytes_since(self, transport: str, mark: Mapping[str, int]) -> bytes:
        """Return the bytes that came on a line after `mark`."""
        return b"".join(one for one in self._since(transport, mark) if isinstance(one, bytes))

    def messages_since(self, transport: str, mark: Mapping[str, int]) -> Sequence[Envelope]:
        """Return the messages that came on a line after `mark`."""
        return [one for one in self._since(transport, mark) if isinstance(one, Envelope)]

    def _since(self, transport: str, mark: Mapping[str, int]) -> Sequence[Payload]:
        return self._heard.get(transport, [])[mark.get(transport, 0) :]

    def emulated_robot(self, settings: Mapping[str, Value]) -> EmulatedRobot:
        """Return the emulated robot, whose lines are overheard."""
        return _Overheard(self.profile, settings, self._heard)


class _Overheard(EmulatedRobot):
    def __init__(
        self,
        profile: Profile,
        settings: Mapping[str, Value],
        heard: dict[str, list[Payload]],
    ) -> None:
        super().__init__(profile, settings)
        self._notes = heard

    def line(self, transport: str) -> EmulatedConnection:
        line = super().line(transport)
        receive, ask, notes = line.receive, line.request, self._notes.setdefault(transport, [])

        def received(data: Payload, now_s: float, limit: int | None = None) -> list[Payload]:
            notes.append(data)
            return receive(data, now_s, limit)

        def asked(data: Payload, now_s: float) -> list[Payload]:
            notes.append(data)
            return ask(data, now_s)

        vars(line).update(receive=received, request=asked)
        return line


def _calm(profile: Profile, lease_s: float) -> Profile:
    """Return a robot with another lease: a browser on a busy machine pauses for some ticks."""
    commands = {
        name: one if one.hold is None else one._replace(hold=one.hold._replace(lease_s=lease_s))
        for name, one in profile.driver.commands.items()
    }
    return profile._replace(driver=profile.driver._replace(commands=commands))


@asynccontextmanager
async def alive(
    name: str, data: Path, patch: pytest.MonkeyPatch, *, lease_s: float = LONGEST_LEASE_S
) -> AsyncIterator[Overheard]:
    """Emulate a robot, and serve it with the guard, as `urc demo` does.

    The guard takes no longer lease than a document may have: with one, motion is in this process.
    """
    profile = _calm(load_profile(str(FOLDER / f"{name}.yaml"), built_in_catalog()), lease_s)
    motion: Motion = "here" if lease_s > LONGEST_LEASE_S else "guarded"
    settings = sample_settings(profile.settings)
    transports = built_in_catalog().transports
    overheard = Overheard(profile)
    patch.setenv("URC_DATA_DIR", str(data))
    async with stand_in(profile, settings, overheard.emulated_robot(settings)) as redirected:

        @asynccontextmanager
        async def session() -> AsyncIterator[Session]:
            overheard.sessions += 1
            try:
                async with Session(redirected, settings, transports, motion=motion) as opened:
                    yield opened
            finally:
                overheard.sessions -= 1

        async with served(Robot(redirected, settings, session)) as address:
            overheard.address = address
            yield overheard


@asynccontextmanager
async def served(robot: Robot) -> AsyncIterator[str]:
    """Serve one robot in this loop; give the address of the menu."""
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app({robot.profile.name: robot}, DashboardOptions(access=ACCESS, linger_s=0.2))
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            await asyncio.wait((ready, task), return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield await ready
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)
