"""An opened profile: the engine, its links, and the hub, from `async with` to the end of it."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import count
from random import random as random_share
from types import TracebackType

from urc.model.driver import Driver
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.protocol.bounds import GOOD_BYE_S, longest_s
from urc.protocol.engine import Engine
from urc.protocol.events import Failed, Replied, Request
from urc.registry import Table
from urc.runtime.clock import Clock, LoopClock, within
from urc.runtime.dispatcher import Dispatcher
from urc.runtime.hub import Hub
from urc.runtime.link import Link
from urc.runtime.settings import options_of, resolve_settings
from urc.transports.base import Transport

__all__ = ["CommandFailed", "Session", "resolve_settings"]

_LOOK_S = 0.02
_GRACE_S = 2.0
"""What a command may take beyond all its declared waits together."""


class CommandFailed(UrcError):
    """A command that was not done.

    `code` is one of ``timed-out``, ``refused``, ``disconnected``, ``bad-argument``, ``queue-full``,
    ``unknown-command``; `message` is for people.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


class Session:
    """One robot, connected for as long as the context lasts. Opened once.

    ``async with Session(profile, settings, catalog.transports) as session:`` starts the links and
    returns at once; what they achieve is in `hub`.
    """

    def __init__(
        self,
        profile: Profile,
        settings: Mapping[str, Value],
        transports: Table,
        *,
        clock: Clock | None = None,
        random: Callable[[], float] = random_share,
    ) -> None:
        """Prepare everything; nothing is opened yet.

        Args:
            profile: as loaded.
            settings: a value for every setting of the profile, as from `resolve_settings`.
            transports: the table of transports.
            clock: the time; the running loop's when left out.
            random: a number from 0 to below 1, for the jitter of the back-off.

        Raises:
            UrcError: a setting has no value, or a transport cannot be made with those given.
        """
        missing = [name for name in profile.settings if settings.get(name) is None]
        if missing:
            raise UrcError(f"{profile.name} needs a value for: {', '.join(missing)}")
        self.profile = profile
        self.settings = dict(settings)
        driver = profile.driver
        self.hub = Hub(driver.signals)
        self._clock: Clock = clock or LoopClock()
        engine = Engine(driver, self.settings)
        self._dispatcher = Dispatcher(engine, self.hub, self._clock, driver.commands)
        self._links: dict[str, Link] = {}
        for name, spec in driver.transports.items():
            factory = transports[spec.type].load()
            transport: Transport = factory(options_of(spec, self.settings))
            link = Link(
                spec,
                transport,
                self._dispatcher,
                self.hub,
                clock=self._clock,
                random=random,
                expects_frames=_expects_frames(driver, name),
            )
            self._dispatcher.attach(name, link)
            self._links[name] = link
        self._numbers = count(1)
        self._group = asyncio.TaskGroup()
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> "Session":
        await self._group.__aenter__()
        self._tasks = [self._group.create_task(link.run()) for link in self._links.values()]
        self._dispatcher.wind_up()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self._say_goodbye()
        self._dispatcher.stop("the session was closed")
        for task in self._tasks:
            task.cancel()
        # An error of the block is the caller's own and passes as it is, not inside a group. Only
        # a cancellation is shown to the group, which may itself have asked for it.
        if isinstance(error, asyncio.CancelledError):
            await self._group.__aexit__(kind, error, trace)
        else:
            await self._group.__aexit__(None, None, None)

    async def _say_goodbye(self) -> None:
        """Run what drivers declare under `on_close`, for as long as that is allowed to take."""
        polite = [
            link
            for name, link in self._links.items()
            if self.profile.driver.transports[name].on_close and link.is_connected
        ]
        if not polite:
            return
        self._dispatcher.finish()
        until = self._clock.now() + GOOD_BYE_S + _GRACE_S
        while any(link.is_connected for link in polite) and self._clock.now() < until:
            await self._clock.sleep(_LOOK_S)

    async def command(self, name: str, arguments: Mapping[str, Value] | None = None) -> Replied:
        """Run a command and return its reply; the wait is always bounded.

        A command that comes while a persistent line is connected for the first time waits for it.

        Args:
            name: as in the driver.
            arguments: name → value; those left out take their defaults.

        Raises:
            CommandFailed: it was refused here or by the robot, timed out, or the robot is gone.
        """
        await self._first_attempt(name)
        request = Request(next(self._numbers), name, arguments or {})
        answer = self._dispatcher.command(request)
        limit_s = self._longest_wait(name)

        def expire() -> None:
            if not answer.done():
                answer.set_result(_late(request, limit_s))

        alarm = self._clock.call_at(self._clock.now() + limit_s, expire)
        try:
            outcome = await answer
        finally:
            alarm.cancel()
            self._dispatcher.forget(request.id)
        if isinstance(outcome, Failed):
            raise CommandFailed(outcome.code, outcome.message)
        return outcome

    async def _first_attempt(self, name: str) -> None:
        command = self.profile.driver.commands.get(name)
        if command is not None and not self._links[command.transport].tried.is_set():
            timeouts = self.profile.driver.transports[command.transport].timeouts
            with suppress(TimeoutError):  # then the engine says that it is not connected
                async with within(self._clock, timeouts.connect_s + _GRACE_S):
                    await self._links[command.transport].tried.wait()

    def _longest_wait(self, name: str) -> float:
        """Return the seconds in which the engine itself must have given an answer."""
        return longest_s(self.profile.driver, name) + _GRACE_S


def _late(request: Request, limit_s: float) -> Failed:
    text = f"no outcome within {limit_s:g} s"
    return Failed(request.id, request.command, "timed-out", text)


def _expects_frames(driver: Driver, transport: str) -> bool:
    """Return whether the robot is to say something on this line without a command."""
    polls = any(poll.transport == transport and poll.reply for poll in driver.polls)
    return polls or any(message.transport == transport for message in driver.messages.values())
