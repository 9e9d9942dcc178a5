"""The HTTP API for robots: descriptions, signals, commands, and motion under a lease.

Layer 5. The routes decode requests and encode responses. The module `sessions` drives robots,
`command_runner` runs commands, and `event_stream` sends signals.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from time import time
from typing import Final, TypeVar

import msgspec
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp

from urc.images import media_type
from urc.model.role import includes
from urc.model.values import BINARY_TYPES, Reading, Signal
from urc.protocol.sequences.commands import questions
from urc.runtime.clock import within
from urc.runtime.contact_times import ContactTimes
from urc.runtime.hub import Hub
from urc.runtime.one_shot_commands import HELD, OUT_OF_SCOPE, role_refusal
from urc.web.api.describe import robot_info, summary
from urc.web.api.documents import document_of
from urc.web.api.event_stream import EventStream
from urc.web.api.limits import RequestLimits
from urc.web.api.overview import in_order
from urc.web.api.readings import plain, value_of, values_of
from urc.web.api.sessions import ProgramSession, ProgramSessions, opened
from urc.web.api.wire import (
    LONGEST_TIMEOUT_S,
    CommandAnswer,
    CommandAsked,
    LeaseAnswer,
    LeaseAsked,
    MotionAsked,
    RobotList,
    RobotSummary,
    SignalValues,
    SiteState,
)
from urc.web.drive.command_runner import COMMAND_TIMEOUT_S, CommandOutcome
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.fleet import service_of
from urc.web.fleet.robots import LiveSession, RobotService
from urc.web.serve.replies import ApiError, Endpoint, answer, answers_errors, body_of
from urc.web.serve.rights import WATCH
from urc.web.serve.visitor import Visitor, peer_of, visitor_of
from urc.wire.client_messages import ApprovalRequest, CommandRequest

__all__ = ["RobotCalls"]

FIRST_VALUE_S: Final = 2.0
"""Longest wait for the first value after connecting to a robot, in seconds."""
_STATUS: Final = {
    "bad-argument": 422,
    "unknown-command": 404,
    "not-confirmed": 428,
    "queue-full": 429,
    "busy": 429,
    "not-allowed": 409,
    "stopped": 409,
}
"""HTTP status for each failure code of a command; all other failure codes come from the robot."""
_BY_ROBOT: Final = 424
_NO_STORE: Final = {"cache-control": "no-store"}
_T = TypeVar("_T")


class RobotCalls:
    """The robot endpoints."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        followed: Callable[[Callable[[], None]], AbstractContextManager[None]],
        times: Callable[[str], ContactTimes],
    ) -> None:
        """Create the endpoints.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            followed: function that takes a callback and returns a context. While the context is
                open, the callback is called after each change of rights.
            times: function that returns when a robot was last used and last sent data.
        """
        self._services = services
        self._followed = followed
        self._times = times
        self.sessions = ProgramSessions(followed)
        self._limits = RequestLimits()
        self.far: Callable[[], Iterable[RobotSummary]] = tuple
        """Function that returns the robots of other sites."""
        self.sites: Callable[[], Iterable[SiteState]] = tuple
        """Function that returns the other sites."""

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {
            "robots": self.robots,
            "robot": self.robot,
            "document": self.document,
            "signals": self.signals,
            "signal": self.signal,
            "stream": self.stream,
            "command": self.command,
            "lease": self.lease,
            "motion": self.motion,
        }

    # Descriptions

    @answers_errors
    async def robots(self, request: Request) -> Response:
        """Return the robots that the visitor may watch."""
        return answer(self.listed(visitor_of(request)))

    def listed(self, visitor: Visitor) -> RobotList:
        """Return the robots that a visitor may watch, with their current state."""
        found = []
        for name, service in self._services().items():
            role = visitor.role(name)
            if role is not None and visitor.may(WATCH, name):
                found.append(summary(name, service, role, self._times(name)))
        for one in self.far():
            role = visitor.role(one.name)
            if role is not None and visitor.may(WATCH, one.name):
                found.append(msgspec.structs.replace(one, role=role))
        sites = tuple(self.sites()) if includes(visitor.role(), "watch") else ()
        return RobotList(in_order(found), time(), sites)

    @answers_errors
    async def robot(self, request: Request) -> Response:
        """Return a robot with its signals and commands."""
        name, service = service_of(self._services(), request)
        visitor = visitor_of(request)
        role = visitor.role(name) or "watch"
        return answer(robot_info(name, service, role, visitor.may_give, self._times(name)))

    @answers_errors
    async def document(self, request: Request) -> Response:
        """Return the document of a robot."""
        _, service = service_of(self._services(), request)
        data = await asyncio.to_thread(document_of, service.robot.profile)
        return Response(data, headers=_NO_STORE, media_type="application/yaml")

    # Signals

    @answers_errors
    async def signals(self, request: Request) -> Response:
        """Return the latest values of all or some signals."""
        name, service = service_of(self._services(), request)
        names = _names(request, service)
        with ExitStack() as stack:
            live = await opened(service, self._peer(request, name), stack)
            hub = live.session.hub
            await _first(service, live, lambda: any(hub.latest(one) for one in hub.signals))
            values = values_of(hub, names, service.clock.now())
        return answer(SignalValues(time(), values))

    @answers_errors
    async def signal(self, request: Request) -> Response:
        """Return the latest value of one signal; send an image as a file."""
        name, service = service_of(self._services(), request)
        wanted = request.path_params["signal"]
        signal = service.robot.profile.driver.signals.get(wanted)
        if signal is None:
            raise ApiError(404, f"{name} has no signal {wanted!r}", "unknown-signal")
        with ExitStack() as stack:
            live = await opened(service, self._peer(request, name), stack)
            hub = live.session.hub
            await _first(service, live, lambda: hub.latest(wanted) is not None)
            if signal.type in BINARY_TYPES:
                await _renewed(service, live, signal)
            sample, now_s = hub.latest(wanted), service.clock.now()
        if signal.type not in BINARY_TYPES:
            return answer(value_of(signal, sample, now_s))
        if sample is None or not isinstance(sample.value, bytes):
            raise ApiError(404, f"no value of {wanted!r} has arrived", "no-value")
        request.state.is_file = True  # the robot's bytes must not act as a URC page
        age_ms = str(round(max(0.0, now_s - sample.time_s) * 1000))
        headers = {**_NO_STORE, "x-urc-age-ms": age_ms}
        return Response(sample.value, headers=headers, media_type=media_type(sample.value))

    async def stream(self, request: Request) -> ASGIApp:
        """Return a stream of changed signals."""
        return await self._stream(request)

    @answers_errors
    async def _stream(self, request: Request) -> Response:
        name, service = service_of(self._services(), request)
        names, peer = _names(request, service), self._peer(request, name)
        visitor = visitor_of(request)
        with ExitStack() as stack:
            live = await opened(service, peer, stack)
        return EventStream(  # type: ignore[return-value]  # an ASGI application, like a response
            live,
            names,
            service.clock,
            may_read=lambda: visitor.may(WATCH, name),
            followed=self._followed,
            visit=service.visit(peer.who),
        )

    # Commands

    @answers_errors
    async def command(self, request: Request) -> Response:
        """Run a command and return its reply."""
        name, service = service_of(self._services(), request)
        asked = await _optional_body(request, CommandAsked, CommandAsked())
        peer, wanted = self._peer(request, name), request.path_params["command"]
        values = await self.run(name, service, peer, wanted, asked)
        return answer(CommandAnswer({key: plain(one) for key, one in values.items()}))

    async def run(
        self, name: str, service: RobotService, peer: SocketPeer, wanted: str, asked: CommandAsked
    ) -> Mapping[str, Reading]:
        """Run a command and return the values of its reply.

        Args:
            name: name of the robot in URLs.
            service: the robot.
            peer: the visitor, who has the right `DRIVE` for the robot.
            wanted: name of the command.
            asked: the arguments and options of the command.

        Raises:
            ApiError: the command was refused, or has failed.
        """
        self._admit(peer, service)
        known = service.robot.profile.driver.commands.get(wanted)
        if known is None:
            raise ApiError(404, f"{name} has no command {wanted!r}", "unknown-command")
        with self._limits.running(peer.who), ExitStack() as stack:
            if asked.session:
                session = self.sessions.find(asked.session, service, peer.identity)
            else:
                live = await opened(service, peer, stack)
                session = stack.enter_context(self.sessions.temporary(service, live, peer))
            controls, operator = service.controls, session.operator
            stack.enter_context(self._followed(lambda: controls.recheck(operator)))
            run = CommandRequest(
                0, wanted, asked.arguments, self._confirmation(session, asked, wanted), asked.stops
            )
            timeout_s = asked.timeout_s or (LONGEST_TIMEOUT_S if known.steps else COMMAND_TIMEOUT_S)
            outcome = await service.commands.run(
                operator, run, session.live.session, timeout_s=timeout_s
            )
            if outcome.code:
                raise _failure(outcome, session, wanted)
        return outcome.values

    def _confirmation(self, session: ProgramSession, asked: CommandAsked, wanted: str) -> str:
        """Return a token for a confirmed command; "" if the command needs no confirmation."""
        known = session.service.robot.profile.driver.commands[wanted]
        questioned = questions(known, asked.arguments)
        if any(one.is_two_person for one in questioned):
            text = "two people must confirm this command: send it from a page"
            raise ApiError(428, text, "needs-two-people")
        if not questioned or not asked.confirmed:
            return ""
        approval = ApprovalRequest(0, wanted, asked.arguments)
        return session.service.consent.prepare(session.operator, approval)

    # Motion

    @answers_errors
    async def lease(self, request: Request) -> Response:
        """Handle a request about the lease or a latched STOP."""
        name, service = service_of(self._services(), request)
        asked = await body_of(request, LeaseAsked)
        peer = self._moving_peer(request, name, service)
        if not service.controls.controller.can_move:
            raise ApiError(409, "this robot has no motion commands", "no-motion")
        if asked.session:
            session = self._session(request, service, asked.session)
            return answer(self._asked(session, asked))
        session = await self.sessions.begin(service, peer)
        try:
            return answer(self._asked(session, asked))
        except ApiError:
            self.sessions.end(session)  # the program never received the session's secret
            raise

    def _asked(self, session: ProgramSession, asked: LeaseAsked) -> LeaseAnswer:
        said = session.ask(asked)
        if asked.verb != "leave":
            return said
        self.sessions.end(session)
        return msgspec.structs.replace(said, session="")

    @answers_errors
    async def motion(self, request: Request) -> Response:
        """Pass an input for a held command to the robot's controls."""
        name, service = service_of(self._services(), request)
        asked = await body_of(request, MotionAsked)
        self._moving_peer(request, name, service)
        return answer(self._session(request, service, asked.session).move(asked))

    # Inside

    def _peer(self, request: Request, name: str) -> SocketPeer:
        return peer_of(request, name)

    def _moving_peer(self, request: Request, name: str, service: RobotService) -> SocketPeer:
        """Return the visitor; raise `ApiError` for a playback or too many requests per second."""
        peer = self._peer(request, name)
        self._admit(peer, service)
        return peer

    def _admit(self, peer: SocketPeer, service: RobotService) -> None:
        self._limits.count(peer.who, service.clock.now())
        if service.robot.playback is not None:
            raise ApiError(409, "a playback accepts no commands", "recorded")

    def _session(self, request: Request, service: RobotService, secret: str) -> ProgramSession:
        return self.sessions.find(secret, service, visitor_of(request).identity)


async def _renewed(service: RobotService, live: LiveSession, signal: Signal) -> None:
    """Wait for a new image if the newest is stale, because images without viewers are paused."""
    hub, clock = live.session.hub, service.clock
    hub.viewers.glance(signal.name, clock.now())
    old = hub.latest(signal.name)
    if old is None or clock.now() - old.time_s <= signal.stale_after_s:
        return
    await _awaited(service, hub, FIRST_VALUE_S, lambda: hub.latest(signal.name) is not old)


async def _first(service: RobotService, live: LiveSession, is_there: Callable[[], bool]) -> None:
    """Wait for the first value, for at most `FIRST_VALUE_S` seconds after connecting."""
    hub = live.session.hub
    left_s = live.began_s + FIRST_VALUE_S - service.clock.now()
    if not is_there() and left_s > 0:
        await _awaited(service, hub, left_s, is_there)


async def _awaited(
    service: RobotService, hub: Hub, most_s: float, is_there: Callable[[], bool]
) -> None:
    """Wait for a change of the hub, for at most `most_s` seconds."""
    with suppress(TimeoutError), hub.subscribe() as subscription:
        async with within(service.clock, most_s):
            while not is_there():
                subscription.seen = hub.revision
                await subscription.changed()


def _names(request: Request, service: RobotService) -> tuple[str, ...]:
    """Return the names from the query parameter ``signals``; by default, all signal names."""
    signals = service.robot.profile.driver.signals
    text = request.query_params.get("signals", "")
    names: Iterable[str] = dict.fromkeys(one.strip() for one in text.split(",") if one.strip())
    for name in names:
        if name not in signals:
            raise ApiError(404, f"there is no signal {name[:200]!r}", "unknown-signal")
    return tuple(names) or tuple(signals)


async def _optional_body(request: Request, kind: type[_T], default: _T) -> _T:
    """Return the decoded body of a request, or `default` for an empty body."""
    return await body_of(request, kind) if await request.body() else default


def _failure(outcome: CommandOutcome, session: ProgramSession, command: str) -> ApiError:
    status, message = _STATUS.get(outcome.code, _BY_ROBOT), outcome.message
    if not (outcome.is_ours and outcome.code == "refused"):
        return ApiError(status, message, outcome.code)
    known = session.service.robot.profile.driver.commands[command]
    if message in (OUT_OF_SCOPE, role_refusal(session.operator.client, known.role)):
        return ApiError(403, message, "forbidden")
    return ApiError(409, message, "held" if message == HELD else "refused")
