"""Audit entries for one server: sign-ins, people, settings, packages, recordings, start and end.

Layer 4. Sign-ins and STOP call these methods, which are therefore thread-safe and never block or
raise an exception. Failed sign-ins and STOPs by unknown visitors are combined into one entry per
second and address, with a count.

Secrets are never written to the log. The name in a failed sign-in is recorded only if a person has
this name, because people sometimes type passphrases into the wrong field.
"""

import json
import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from getpass import getuser
from typing import Final, Literal, NamedTuple

from urc.runtime.audit_entry import AuditEntry
from urc.runtime.repeat_limiter import RepeatLimiter
from urc.runtime.secret_forms import HIDDEN, SecretForms

__all__ = ["CLOCK_JUMP_S", "NO_ACTOR", "Actor", "ServerRecorder", "terminal_actor"]

CLOCK_JUMP_S: Final = 5.0
"""Minimum jump of the machine's clock that is recorded, in seconds."""
_BURST: Final = 60
"""Maximum number of entries about unknown visitors in one burst."""
_PER_S: Final = 0.1
"""Maximum mean rate of entries about unknown visitors, in entries per second; an attack of one day
fills 3 MB of the log's 100 MB."""
_MOST_SECRETS: Final = 256
_USERINFO: Final = re.compile(r"//[^/@\s\"]*@")
"""Pattern for the user name and passphrase in a URL."""

log = logging.getLogger(__name__)


class Actor(NamedTuple):
    """The person, device or program that caused an event, and the right that permitted it."""

    name: str = ""
    principal: str = ""
    """Identifier; "" for an unknown visitor."""
    kind: str = ""
    """Kind of the actor: ``person``, ``device``, ``program`` or ``guest``."""
    role: str = ""
    way: str = ""
    """Sign-in method, such as ``passkey``; ``terminal`` for a command on this machine."""
    place: str = ""
    """Network address; "" for this machine."""
    sign_in: str = ""
    """Identifier of the sign-in; not a secret."""


NO_ACTOR: Final = Actor()


class _Repeated(NamedTuple):
    what: str
    actor: Actor
    robot: str
    command: str
    outcome: str


class ServerRecorder:
    """A writer of audit entries for one server or one command."""

    def __init__(
        self,
        note: Callable[[AuditEntry], None],
        *,
        utc: Callable[[], float] = time.time,
        now: Callable[[], float] = time.monotonic,
        secrets: Iterable[str] = (),
    ) -> None:
        """Create a recorder that passes each audit entry to `note`.

        Args:
            note: callback for each entry; must not block.
            utc: source of UTC time, in seconds since 1970.
            now: source of monotonic time, in seconds.
            secrets: strings to redact, such as the start key.
        """
        self.is_faulty = False
        """Whether a bug in URC has prevented the recording of an entry."""
        self._note = note
        self._utc = utc
        self._now = now
        self._lock = threading.Lock()
        self._repeats = RepeatLimiter[_Repeated](_BURST, _PER_S)
        self._ahead_s = utc() - now()
        self._secrets: tuple[str, ...] = ()
        self._forms = SecretForms()
        self.hide(secrets)

    def hide(self, secrets: Iterable[str]) -> None:
        """Add strings to redact in later entries."""
        known = dict.fromkeys((*(one for one in secrets if one), *self._secrets))
        self._secrets = tuple(known)[:_MOST_SECRETS]
        self._forms = SecretForms(self._secrets)

    # Sign-ins

    def signed_in(self, actor: Actor, agent: str = "") -> None:
        """Record a sign-in; `agent` is text with the names of the browser and the system."""
        self._record("signed in", actor, outcome=agent)

    def sign_in_failed(
        self, way: str, place: str, reason: str, *, name: str = "", principal: str = ""
    ) -> None:
        """Record a failed attempt to sign in or pair; identical attempts are counted.

        Args:
            way: sign-in method that the visitor tried, such as ``passphrase``.
            place: network address.
            reason: reason to display, which must not contain any of the visitor's input.
            name: name of the person, device or program in the attempt; "" for an unknown name.
            principal: identifier of the person, device or program; without an identifier, the name
                is not recorded.
        """
        actor = Actor(name if principal else "", principal, way=way, place=place)
        self._repeat(_Repeated("sign-in failed", actor, "", "", reason))

    def signed_out(self, actor: Actor) -> None:
        """Record that a person has ended their own sign-in."""
        self._record("signed out", actor)

    def revoked(self, actor: Actor, what: str, **about: object) -> None:
        """Record that an administrator has ended another person's sign-in, token or right.

        Args:
            actor: the administrator.
            what: kind of right that was ended, such as ``sign-in`` or ``device``.
            about: further facts for the entry, such as the name of the right; never a secret.
        """
        self._record("revoked", actor, what, arguments=about)

    def paired(
        self, actor: Actor, step: Literal["code made", "code used"], **about: object
    ) -> None:
        """Record that a pairing code was made or used; `about` never contains the code."""
        self._record("pairing", actor, step, arguments=about)

    # Fleets

    def visited(self, actor: Actor, robot: str, site: str, visit: str, outcome: str) -> None:
        """Record the begin, a changed role or the refusal of a visit; identical ones are counted.

        Args:
            actor: the visitor, with the role at this site.
            robot: name of the robot.
            site: the other site.
            visit: identifier of the visit in the audit logs of both sites.
            outcome: result as text for display.
        """
        self._repeat(_Repeated("visit", actor._replace(sign_in=visit), robot, site, outcome))

    # Administration

    def access_changed(self, actor: Actor, command: str, **about: object) -> None:
        """Record a change to people, devices, programs or their roles.

        Args:
            actor: the administrator.
            command: the change, such as ``people grant`` or ``tokens add``.
            about: names, roles and times, without secrets.
        """
        self._record("access", actor, command, arguments=about)

    def settings_changed(
        self, actor: Actor, robot: str, changes: Mapping[str, str | None], *, is_saved: bool = True
    ) -> None:
        """Record changed settings.

        Args:
            actor: the person.
            robot: name of the robot; "" for the server.
            changes: new text of each changed setting; None for a secret.
            is_saved: whether the settings were stored.
        """
        shown = {name: HIDDEN if text is None else text for name, text in changes.items()}
        outcome = "saved" if is_saved else "not saved"
        self._record("settings", actor, robot=robot, arguments=shown, outcome=outcome)

    def package_changed(
        self, actor: Actor, command: str, packages: Iterable[str], outcome: str = "done"
    ) -> None:
        """Record a change to packages or repositories.

        Args:
            actor: the person.
            command: the change, such as ``install``, ``update``, ``remove`` or ``repository add``.
            packages: packages with versions, or addresses of repositories.
            outcome: result as text for display.
        """
        about = {"packages": list(packages)}
        self._record("package", actor, command, arguments=about, outcome=outcome)

    def recording(
        self,
        actor: Actor,
        robot: str,
        step: Literal["started", "ended", "downloaded", "deleted"],
        file: str,
        outcome: str = "",
    ) -> None:
        """Record the start, end, download or deletion of the recording with the name `file`."""
        self._record("recording", actor, step, robot, {"file": file}, outcome)

    def alarm(
        self, actor: Actor, robot: str, step: str, signals: Iterable[str], **about: object
    ) -> None:
        """Record an operator's action on alarms.

        Args:
            actor: the person, device or program.
            robot: name of the robot.
            step: what the operator did: ``acknowledged``, ``shelved`` or ``unshelved``.
            signals: signals of the alarms.
            about: further facts, such as how long an alarm is shelved.
        """
        self._record("alarm", actor, step, robot, {"signals": [*signals], **about})

    def audit_exported(self, actor: Actor) -> None:
        """Record that the audit log was downloaded."""
        self._record("audit", actor, "exported")

    # The server

    def server(self, step: Literal["started", "ended"], version: str, **about: object) -> None:
        """Record the server's start or end; the end also writes all pending counts."""
        if step == "ended":
            self.flush(is_last=True)
        self._record("server", NO_ACTOR, step, arguments={"version": version, **about})

    def stopped_by_unknown(self, robot: str, place: str) -> None:
        """Record a press of STOP by a visitor without a sign-in; identical presses are counted."""
        actor = Actor(place=place)
        self._repeat(_Repeated("STOP", actor, robot, "", "pressed without a sign-in"))

    def far_stop(self, actor: Actor, robot: str, stop_id: str, outcome: str) -> None:
        """Record the STOP of a robot of another site; presses without a sign-in are counted.

        Args:
            actor: the visitor of this server.
            robot: name of the robot with its site.
            stop_id: identifier of the STOP, as in the audit log of the other site.
            outcome: result as text for display.
        """
        if not actor.principal:
            self.stopped_by_unknown(robot, actor.place)
            return
        self._record("STOP", actor, robot=robot, arguments={"stop": stop_id}, outcome=outcome)

    def check_clock(self) -> None:
        """Record a jump if the machine's clock was set since the last call."""
        ahead_s = self._utc() - self._now()
        jump_s, self._ahead_s = ahead_s - self._ahead_s, ahead_s
        if abs(jump_s) >= CLOCK_JUMP_S:
            way = "ahead" if jump_s > 0 else "back"
            text = (
                f"the clock jumped {way} by {abs(jump_s):.0f} s: it was set, or the machine slept"
            )
            self._record("clock", NO_ACTOR, outcome=text, lasted_s=round(jump_s, 1))

    def flush(self, *, is_last: bool = False) -> None:
        """Write all due counts of repeated events; if `is_last` is true, write every count."""
        with self._lock:
            now = None if is_last else self._now()
            forgotten = self._repeats.forgotten(now)
            due = [*(self._repeats.rest() if now is None else self._repeats.due(now))]
        for key, count in due:
            self._tell(key, count)
        if forgotten:
            text = "further failed sign-ins and presses of STOP"
            self._record("sign-in failed", NO_ACTOR, outcome=text, times=forgotten)

    # Inside

    def _repeat(self, key: _Repeated) -> None:
        with self._lock:
            count = self._repeats.count(key, self._now())
        if count:
            self._tell(key, count)

    def _tell(self, key: _Repeated, count: int) -> None:
        self._record(key.what, key.actor, key.command, key.robot, outcome=key.outcome, times=count)

    def _record(
        self,
        what: str,
        actor: Actor,
        command: str = "",
        robot: str = "",
        arguments: Mapping[str, object] | None = None,
        outcome: str = "",
        *,
        times: int = 1,
        lasted_s: float = 0.0,
    ) -> None:
        try:
            text = json.dumps(arguments, ensure_ascii=False, default=str) if arguments else ""
            entry = AuditEntry(
                at=self._utc(),
                robot=robot,
                what=what,
                who=self._hidden(actor.name),
                role=actor.role,
                client=actor.sign_in,
                command=self._hidden(command),
                arguments=self._hidden(text),
                outcome=self._hidden(outcome),
                times=times,
                lasted_s=lasted_s,
                principal=actor.principal,
                kind=actor.kind,
                way=actor.way,
                place=actor.place,
            )
            self._note(entry)
        except Exception:  # supervisor: signing in and STOP must continue
            if not self.is_faulty:
                log.exception("an event is missing from the audit log")
            self.is_faulty = True

    def _hidden(self, text: str) -> str:
        return _USERINFO.sub(f"//{HIDDEN}@", self._forms.hide(text))


def terminal_actor() -> Actor:
    """Return this process's user, who may administer URC through access to the data folder."""
    return Actor(f"{_user()} on this computer", "local", "person", "administer", "terminal")


def _user() -> str:
    """Return the user name of this process, from the system and not from the environment."""
    try:
        if sys.platform == "win32":
            return getuser()
        import pwd

        return pwd.getpwuid(os.getuid()).pw_name
    except (OSError, KeyError, ImportError):
        return f"user {os.getuid()}" if hasattr(os, "getuid") else "unknown user"
