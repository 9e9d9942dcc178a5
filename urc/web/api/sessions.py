"""Operator sessions of programs that drive over HTTP.

Layer 5. A page has a socket, so the server notices immediately when the page disconnects. A program
has no socket and sends only separate requests. Its operator session therefore ends after `IDLE_S`
seconds without a request, or when the program's right ends. Motion stops earlier, because the lease
of a held command lasts at most one second.
"""

import secrets
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from hmac import compare_digest
from typing import Final

import msgspec

from urc.access.directory import Identity
from urc.model.role import includes
from urc.motion.lease import LeaseState
from urc.problems import UrcError
from urc.runtime.clock import Timer
from urc.web.api.wire import LeaseAnswer, LeaseAsked, MotionAnswer, MotionAsked, MotionNotice
from urc.web.drive.operator_session import OperatorSession
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import LiveSession, RobotService, SessionFailed, missing_settings
from urc.web.serve.replies import ApiError
from urc.wire.client_messages import Drive, Release, Tick

__all__ = ["IDLE_S", "MOST_SESSIONS", "ProgramSession", "ProgramSessions"]

IDLE_S: Final = 10.0
"""Time for which a session stays open after its last request, in seconds."""
MOST_SESSIONS: Final = 8
"""Maximum number of one visitor's open sessions, counted across all robots."""
_Followed = Callable[[Callable[[], None]], AbstractContextManager[None]]


class ProgramSession:
    """The session in which one program drives one robot."""

    def __init__(self, service: RobotService, live: LiveSession, peer: SocketPeer) -> None:
        """Add the program to the robot's operators.

        Raises:
            UrcError: too many operators watch the robot.
        """
        self.service = service
        self.live = live
        self.peer = peer
        self.secret = secrets.token_urlsafe(16)
        self.operator: OperatorSession = service.controls.add_page(peer, _ignore)

    @property
    def epoch(self) -> int:
        """Number of the current lease, which each motion request must repeat."""
        return self._lease.epoch

    @property
    def _lease(self) -> LeaseState:
        return self.service.controls.controller.lease.state

    @property
    def _drives(self) -> bool:
        holder = self._lease.holder
        return holder is not None and holder.id == self.operator.client.id

    @property
    def beat(self) -> int | None:
        """Newest heartbeat number; None if the program does not drive."""
        if not self._drives:
            return None
        if self.operator.heartbeat is None:  # the next heartbeat is due within a few milliseconds
            controller, now = self.service.controls.controller, self.service.clock.now()
            self.operator.heartbeat = controller.heartbeat(self.operator.client.id, now)
        return self.operator.heartbeat

    def ask(self, asked: LeaseAsked) -> LeaseAnswer:
        """Handle a request about the lease or a latched STOP; return the state of the controls.

        Raises:
            ApiError: the request was refused.
        """
        if asked.verb != "keep":
            self.service.controls.handle(self.operator, Drive(asked.verb, asked.for_s, asked.stops))
            refused = self.operator.notices.pop(asked.verb, "")
            if refused:
                notice = _notice(refused)
                raise ApiError(409, notice.message if notice is not None else "", "refused")
        state = self._lease
        return LeaseAnswer(
            session=self.secret,
            name=self.operator.client.name,
            drives=self._drives,
            epoch=state.epoch,
            holder=state.holder.name if state.holder is not None else "",
            asker=state.asked_by.name if state.asked_by is not None else "",
            latched=state.latched_by,
            stops=state.stops,
            beat=self.beat,
            idle_s=IDLE_S,
            notices=self.notices(),
        )

    def move(self, asked: MotionAsked) -> MotionAnswer:
        """Pass an input for a held command to the robot's controls.

        Raises:
            ApiError: the input was refused.
        """
        controls, operator, command = self.service.controls, self.operator, asked.command
        if asked.release:
            controls.handle(operator, Release(command))
        else:
            before = operator.moved_s.get(command)
            tick = Tick(command, asked.epoch, asked.number, asked.beat, asked.arguments)
            controls.handle(operator, tick)
            is_queued = command in operator.pending
            if not is_queued and operator.moved_s.get(command) == before:
                raise ApiError(409, self._refusal(asked), "refused")
        return MotionAnswer(self.epoch, self.beat, command in operator.pending, self.notices())

    def _refusal(self, asked: MotionAsked) -> str:
        """Return the reason why the server refused the input."""
        for notice in self.notices():
            if notice.kind == "refused":
                return notice.message
        lease = self.service.controls.controller.lease
        late = "the input is too old, or not newer than the last input; send the newest heartbeat"
        return lease.refusal(self.operator.client.id, asked.epoch) or late

    def notices(self) -> tuple[MotionNotice, ...]:
        """Return the notices since the last call."""
        texts = list(self.operator.notices.values())
        self.operator.notices.clear()
        return tuple(filter(None, map(_notice, texts)))


class ProgramSessions:
    """The open sessions of all programs."""

    def __init__(self, followed: _Followed) -> None:
        """Start with no open sessions.

        Args:
            followed: function that takes a callback and returns a context. While the context is
                open, the callback is called after each change of rights.
        """
        self._followed = followed
        self._open: dict[str, _OpenSession] = {}
        """Secret → session."""

    @contextmanager
    def temporary(
        self, service: RobotService, live: LiveSession, peer: SocketPeer
    ) -> Iterator[ProgramSession]:
        """Add an operator for one command; remove the operator when the context closes."""
        session = _entered(service, live, peer)
        try:
            yield session
        finally:
            service.controls.remove_page(session.operator)

    async def begin(self, service: RobotService, peer: SocketPeer) -> ProgramSession:
        """Open a session and connect to the robot.

        Raises:
            ApiError: URC cannot connect to the robot, or too many sessions are open.
        """
        mine = [one for one in self._open.values() if one.session.peer.who == peer.who]
        if len(mine) >= MOST_SESSIONS:
            raise ApiError(429, f"{MOST_SESSIONS} sessions are open; close one first", "too-many")
        with ExitStack() as stack:
            live = await opened(service, peer, stack)
            session = _entered(service, live, peer)
            stack.callback(service.controls.remove_page, session.operator)
            stack.enter_context(self._followed(lambda: self._recheck(session)))
            self._open[session.secret] = _OpenSession(session, stack.pop_all())
        self._touch(session)
        return session

    def find(self, secret: str, service: RobotService, who: Identity) -> ProgramSession:
        """Return an open session; the session now stays open for another `IDLE_S` seconds.

        Raises:
            ApiError: the session is not open, or it belongs to another visitor or robot.
        """
        kept = next(
            (
                one
                for key, one in self._open.items()
                if compare_digest(key.encode(), secret.encode())
            ),
            None,
        )
        # Another visitor's session gets the same answer, so that the answer never confirms a
        # secret.
        is_ours = (
            kept is not None
            and kept.session.service is service
            and kept.session.peer.identity == who
        )
        if kept is None or not is_ours:
            raise ApiError(404, "this session does not exist, or has ended", "no-session")
        if kept.session.live.ended.is_set():
            self.end(kept.session)
            raise ApiError(409, "the session of the robot has ended", "no-session")
        self._touch(kept.session)
        return kept.session

    def end(self, session: ProgramSession) -> None:
        """End a session: stop its held commands and release its lease."""
        kept = self._open.pop(session.secret, None)
        if kept is not None:
            if kept.alarm is not None:
                kept.alarm.cancel()
            kept.stack.close()

    def close(self) -> None:
        """End all sessions."""
        for kept in list(self._open.values()):
            self.end(kept.session)

    def _touch(self, session: ProgramSession) -> None:
        kept, clock = self._open[session.secret], session.service.clock
        if kept.alarm is not None:
            kept.alarm.cancel()
        kept.alarm = clock.call_at(clock.now() + IDLE_S, lambda: self.end(session))

    def _recheck(self, session: ProgramSession) -> None:
        session.service.controls.recheck(session.operator)
        if not includes(session.peer.rights.role(), "drive"):
            self.end(session)


class _OpenSession:
    def __init__(self, session: ProgramSession, stack: ExitStack) -> None:
        self.session = session
        self.stack = stack
        self.alarm: Timer | None = None


async def opened(service: RobotService, peer: SocketPeer, stack: ExitStack) -> LiveSession:
    """Keep a robot connected until `stack` closes; return its open session.

    Raises:
        ApiError: URC cannot connect to the robot, or too many clients use it.
    """
    missing = missing_settings(service.robot)
    if missing:
        names = ", ".join(setting.name for setting in missing)
        raise ApiError(409, f"settings are missing: {names}", "not-ready")
    if service.is_full or not service.has_room_for(peer):
        raise ApiError(429, "too many clients are using this robot", "too-many")
    stack.enter_context(service.visit(peer.who))
    try:
        return await service.live()
    except SessionFailed as error:
        raise ApiError(409, str(error), "not-connected") from None


def _entered(service: RobotService, live: LiveSession, peer: SocketPeer) -> ProgramSession:
    try:
        return ProgramSession(service, live, peer)
    except UrcError as error:
        raise ApiError(429, str(error), "too-many") from None


def _notice(text: str) -> MotionNotice | None:
    """Convert a message for pages to a notice; return None if only pages can use the message."""
    said = msgspec.json.decode(text, type=dict[str, object])
    if said.get("t") == "refused":
        about = said.get("command") or said.get("about")
        return MotionNotice("refused", str(about), str(said.get("message")))
    if said.get("t") == "stopped":
        return MotionNotice("stopped", str(said.get("command")), str(said.get("reason")))
    return None  # a question for a second person; only pages can answer it


def _ignore() -> None:
    """Do nothing, because programs poll for messages."""
