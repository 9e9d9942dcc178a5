"""Write one robot's audit entries: two for each motion, instead of one for each tick.

Layer 4. The module is synchronous: callers pass the current time. The functions never block and
never raise an exception, because motion code calls them. Each motion has a start entry and an end
entry, with the first and last values of the motion. Repeated refusals are combined into one entry
per second, with a count. The audit log therefore shows the cause of each motion without growing
with every tick.
"""

import json
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from typing import Concatenate, Final, ParamSpec

from urc.model.payload import Payload, traffic_of
from urc.model.values import NOTHING, Reading
from urc.motion.lease import LeaseState, Operator
from urc.runtime.audit_entry import AuditEntry, shown
from urc.runtime.hub import AuditRecord, Hub, MotionRecord
from urc.runtime.repeat_limiter import RepeatLimiter
from urc.runtime.secret_forms import HIDDEN, SecretForms

__all__ = ["AuditRecorder"]

_NOBODY: Final = Operator("", "", "watch")
_MOST_SECRETS: Final = 256
_LONGEST_NAME: Final = 100
_LONGEST_TEXT: Final = 1000

log = logging.getLogger(__name__)
_P = ParamSpec("_P")


def _harmless(
    take: "Callable[Concatenate[AuditRecorder, _P], None]",
) -> "Callable[Concatenate[AuditRecorder, _P], None]":
    """Catch every exception, so that a bug in the audit code cannot stop motion.

    Log only the first exception.
    """

    @wraps(take)
    def taken(self: "AuditRecorder", /, *args: _P.args, **named: _P.kwargs) -> None:
        try:
            take(self, *args, **named)
        except Exception:  # supervisor: motion and STOP must continue
            if not self.is_faulty:
                log.exception("an event is missing from the audit log of %s", self.robot)
            self.is_faulty = True

    return taken


@dataclass(slots=True)
class _Motion:
    client: Operator
    epoch: int
    began_s: float
    count: int = 0
    arguments: Mapping[str, Reading] = field(default_factory=dict)
    data: Payload = b""


class AuditRecorder:
    """A writer of audit entries for one robot."""

    def __init__(
        self,
        robot: str,
        note: Callable[[AuditEntry], None],
        *,
        utc: Callable[[], float],
        secrets: Iterable[str] = (),
    ) -> None:
        """Create a recorder with no motion in progress.

        Args:
            robot: name of the robot.
            note: callback for each entry; it must not block.
            utc: source of UTC time, in seconds since 1970.
            secrets: strings to redact, such as the values of secret settings.
        """
        self.robot = robot
        self.is_faulty = False
        """Whether a bug in URC has prevented the recording of an entry."""
        self._note = note
        self._hub: Hub | None = None
        self._now: Callable[[], float] = _never
        self._utc = utc
        self._secrets: tuple[str, ...] = ()
        self._disguises = SecretForms()
        self.hide(secrets)
        self._motions: dict[str, _Motion] = {}
        self._refusals = RepeatLimiter[tuple[str, str, str]]()
        self._lease = LeaseState()
        self._cause: Operator | None = None
        self._stop_id = ""

    def attend(self, hub: Hub | None, now: Callable[[], float]) -> None:
        """From now on, also report each entry to the taps of a session's hub.

        Passing None as the hub ends the reports.
        """
        self._hub, self._now = hub, now

    def hide(self, secrets: Iterable[str]) -> None:
        """Add strings to redact in later entries."""
        known = dict.fromkeys((*(one for one in secrets if one), *self._secrets))
        self._secrets = tuple(known)[:_MOST_SECRETS]
        self._disguises = SecretForms(self._secrets)

    @_harmless
    def moved(
        self,
        client: Operator,
        epoch: int,
        command: str,
        arguments: Mapping[str, Reading],
        data: Payload,
        now: float,
    ) -> None:
        """Record an accepted tick and its frame."""
        if self._hub is not None and self._hub.is_tapped:
            self._hub.publish_record(MotionRecord(now, command, arguments))
        motion = self._motions.get(command)
        if motion is None or motion.client != client or motion.epoch != epoch:
            self.stopped(command, "taken over", now)
            motion = self._motions[command] = _Motion(client, epoch, now)
            self._record(
                "moved",
                client,
                epoch=epoch,
                command=command,
                arguments=self._arguments(arguments),
                data=self._data(data),
                outcome="begins",
            )
        motion.count += 1
        motion.arguments, motion.data = arguments, data

    @_harmless
    def stopped(self, command: str, reason: str, now: float) -> None:
        """Record that a control has stopped, and why."""
        motion = self._motions.pop(command, None)
        if motion is None:
            return
        self._record(
            "stopped",
            motion.client,
            epoch=motion.epoch,
            command=command,
            arguments=self._arguments(motion.arguments),
            data=self._data(motion.data),
            outcome=reason,
            times=motion.count,
            lasted_s=round(now - motion.began_s, 3),
        )

    @_harmless
    def refused(self, client: Operator, about: str, message: str, now: float) -> None:
        """Record that a tick or request was refused; `about` names the control or the request."""
        about, message = about[:_LONGEST_NAME], message[:_LONGEST_TEXT]
        if count := self._refusals.count((client.id, about, message), now):
            outcome = self._hidden(message)
            self._record("refused", client, command=about, outcome=outcome, times=count)

    @contextmanager
    def caused_by(self, operator: Operator | None, stop_id: str = "") -> Iterator[None]:
        """Record `operator` as the cause of STOP and its reset while the context is open.

        `stop_id` identifies the STOP of several robots; "" for the STOP of one robot.
        """
        before, self._cause = (self._cause, self._stop_id), operator
        self._stop_id = stop_id
        try:
            yield
        finally:
            self._cause, self._stop_id = before

    @_harmless
    def leased(self, state: LeaseState, now: float) -> None:
        """Record a change of the lease: its holder, a request for control, STOP or its reset."""
        before, self._lease = self._lease, state
        cause = self._cause or _NOBODY
        if state.latched_by and not before.latched_by:
            about = _json({"stop": self._stop_id}) if self._stop_id else ""
            outcome = f"by {state.latched_by}"
            self._record("STOP", cause, epoch=state.epoch, arguments=about, outcome=outcome)
        elif before.latched_by and not state.latched_by:
            self._record("reset", cause, epoch=state.epoch, outcome="may be driven again")
        if state.holder != before.holder:
            who = state.holder or before.holder or _NOBODY
            outcome = "has the controls" if state.holder else "gave the controls back"
            self._record("lease", who, epoch=state.epoch, outcome=outcome)
        if state.asked_by is not None and state.asked_by != before.asked_by:
            self._record(
                "lease", state.asked_by, epoch=state.epoch, outcome="asks for the controls"
            )

    @_harmless
    def overrode(self, client: Operator, epoch: int, for_s: float) -> None:
        """Record that an operator may drive without an image for `for_s` seconds."""
        outcome = f"may drive without an image for {for_s:g} s"
        self._record("override", client, epoch=epoch, outcome=outcome)

    @_harmless
    def ran(
        self,
        client: Operator,
        command: str,
        arguments: Mapping[str, Reading],
        outcome: str,
        data: Payload = b"",
        answer: Mapping[str, Reading] = NOTHING,
    ) -> None:
        """Record a command without `hold`; its outcome is ``done`` or the reason for a failure."""
        if answer:
            outcome = f"{outcome}: {_json(answer)}"
        self._record(
            "ran",
            client,
            command=command,
            arguments=self._arguments(arguments),
            data=self._data(data),
            outcome=self._hidden(outcome),
        )

    def _record(
        self,
        what: str,
        who: Operator,
        *,
        epoch: int = 0,
        command: str = "",
        arguments: str = "",
        data: str = "",
        outcome: str = "",
        times: int = 1,
        lasted_s: float = 0.0,
    ) -> None:
        entry = AuditEntry(
            at=self._utc(),
            robot=self.robot,
            what=what,
            who=who.name,
            role=(who.role or "") if who is not _NOBODY else "",
            client=who.id,
            epoch=epoch,
            command=command,
            arguments=arguments,
            data=data,
            outcome=outcome,
            times=times,
            lasted_s=lasted_s,
            principal=who.principal,
            kind=who.kind,
            way=who.way,
            place=who.place,
        )
        self._note(entry)
        if self._hub is not None:
            self._hub.publish_record(AuditRecord(self._now(), entry))

    def _arguments(self, arguments: Mapping[str, Reading]) -> str:
        return self._hidden(_json(arguments))

    def _data(self, data: Payload) -> str:
        shown_bytes = traffic_of(data)
        if self._disguises.are_in(shown_bytes):
            return HIDDEN
        return shown(shown_bytes) if shown_bytes else ""

    def _hidden(self, text: str) -> str:
        """Return text without the secrets and their encoded forms."""
        return self._disguises.hide(text)


def _never() -> float:
    return 0.0


def _json(values: Mapping[str, Reading]) -> str:
    return json.dumps(dict(values), default=_plain, ensure_ascii=False)


def _plain(value: object) -> str:
    return f"{len(value)} bytes" if isinstance(value, bytes) else repr(value)
