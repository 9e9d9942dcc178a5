"""Alarm notifications through the maintainer's hook: a command or a URL.

Layer 5. `AlarmNotifier.queue` never blocks. A separate thread collects alarms for one second, then
calls the hook once for each affected robot. During a flood, the hook is called at most once a
minute for the affected robot. The queue is bounded, each attempt has a timeout, and failures are
counted and logged. The hook never receives robot secrets, because the hub removes them from all
values.
"""

import asyncio
import json
import logging
import os
import signal
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple

import httpx2

from urc.alarms.record import PRIORITIES, AlarmEvent
from urc.problems import UrcError
from urc.runtime.robot_alarms import RobotAlarms
from urc.web.alarms.notify_options import NotifyOptions
from urc.web.show.cells import spoken

__all__ = ["AlarmNotifier", "NotifyCount", "NotifyFailed"]

GATHER_S: Final = 1.0
"""How long alarms are collected for one notification, in seconds."""
FLOOD_GAP_S: Final = 60.0
"""Minimum time between two notifications about a robot with an alarm flood, in seconds."""
MOST_WAITING: Final = 1000
"""Maximum number of queued alarms."""
MOST_SHOWN: Final = 50
"""Maximum number of alarms listed in one notification; further alarms are only counted."""
_WAITS_S: Final = (2.0, 5.0, 10.0, 20.0)
"""Delays before the retries, in seconds."""
_CLOSE_S: Final = 2.0

log = logging.getLogger(__name__)


class NotifyFailed(UrcError):
    """A call to the maintainer's hook failed."""


class NotifyCount(NamedTuple):
    """Counts of notifications since the server started."""

    sent: int
    failed: int
    """Number of notifications for which every attempt failed."""
    lost: int
    """Number of alarms dropped because the queue was full."""


class _QueuedAlarm(NamedTuple):
    robot: str
    title: str
    is_flooded: bool
    alarm: dict[str, Any]


class AlarmNotifier:
    """A queue of all robots' alarms, with a thread that calls the hook."""

    def __init__(self, options: NotifyOptions, now: Callable[[], float] = time.monotonic) -> None:
        """Prepare the queue; the thread starts when the first alarm is queued."""
        self._options = options
        self._now = now
        self._waiting: list[_QueuedAlarm] = []
        self._next_at: dict[str, float] = {}
        """Earliest time for the next notification about each robot with an alarm flood."""
        self._counts: Counter[str] = Counter()
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_busy = False
        self._thread: threading.Thread | None = None

    @property
    def count(self) -> NotifyCount:
        """The counts of notifications since the server started."""
        return NotifyCount(*(self._counts[one] for one in NotifyCount._fields))

    def queue(
        self, robot: str, title: str, alarms: RobotAlarms, events: Sequence[AlarmEvent]
    ) -> None:
        """Queue the alarms that need a notification and return immediately.

        Shelved and suppressed alarms cause no notification.
        """
        found = [
            _QueuedAlarm(robot, title, alarms.list.is_flooded, _alarm(one, alarms))
            for one in events
            if self._is_notified(one)
        ]
        if not found:
            return
        with self._wakes:
            self._waiting += found
            # Drop the oldest alarms: the newest ones describe the present.
            excess = len(self._waiting) - MOST_WAITING
            if excess > 0:
                del self._waiting[:excess]
                self._counts["lost"] += excess
            if self._thread is None and not self._is_closing:
                self._thread = threading.Thread(target=self._run, name="urc-notify", daemon=True)
                self._thread.start()
            self._wakes.notify()

    def _is_notified(self, event: AlarmEvent) -> bool:
        if PRIORITIES.index(event.priority) > PRIORITIES.index(self._options.priority):
            return False
        if event.kind == "raised":
            return event.state == "unacknowledged"
        is_shown = event.state in ("normal", "returned")
        return event.kind == "returned" and self._options.has_returned and is_shown

    def settle(self, timeout_s: float) -> bool:
        """Wait until the queue is empty and idle; return False after the timeout."""
        with self._wakes:
            return self._wakes.wait_for(lambda: not (self._waiting or self._is_busy), timeout_s)

    def close(self) -> None:
        """Drop the queued alarms and end the thread."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify_all()
        if self._thread is not None:
            self._thread.join(_CLOSE_S)

    # The thread

    def _run(self) -> None:
        while batch := self._next_batch():
            for robot in dict.fromkeys(one.robot for one in batch):
                self._notify(robot, [one for one in batch if one.robot == robot])

    def _next_batch(self) -> list[_QueuedAlarm]:
        """Wait for due alarms and return them; return [] after `close`."""
        with self._wakes:
            self._is_busy = False
            self._wakes.notify_all()
            self._wakes.wait_for(lambda: self._waiting or self._is_closing)
            self._pause(GATHER_S)
            while not self._is_closing:
                now = self._now()
                # Checked per robot: one robot's flood must not delay another robot's alarms.
                due = [one for one in self._waiting if self._next_at.get(one.robot, 0.0) <= now]
                if due:
                    self._waiting = [one for one in self._waiting if one not in due]
                    self._is_busy = True
                    return due
                self._wakes.wait(GATHER_S)
            return []

    def _pause(self, seconds: float) -> None:
        """Wait for `seconds`, but no longer than until the notifier closes."""
        self._wakes.wait_for(lambda: self._is_closing, seconds)

    def _notify(self, robot: str, batch: Sequence[_QueuedAlarm]) -> None:
        is_flooded = batch[-1].is_flooded
        if is_flooded:
            self._next_at[robot] = self._now() + FLOOD_GAP_S
        else:
            self._next_at.pop(robot, None)
        news = {
            "robot": robot,
            "title": batch[0].title,
            "time": time.time(),
            "flood": is_flooded,
            "alarms": [one.alarm for one in batch[:MOST_SHOWN]],
            "more": max(0, len(batch) - MOST_SHOWN),
        }
        data = json.dumps(news, ensure_ascii=False).encode()
        for wait_s in (*_WAITS_S[: self._options.tries - 1], None):
            try:
                self._call(data)
                self._counts["sent"] += 1
                return
            except NotifyFailed as error:
                log.warning("the alarm notification for %s failed: %s", robot, error)
            except Exception:  # supervisor: the next notification is always tried
                log.exception("the alarm notification for %s failed", robot)
            if wait_s is None or self._is_closing:
                break
            with self._wakes:
                self._pause(wait_s)
        self._counts["failed"] += 1

    def _call(self, data: bytes) -> None:
        """Call the hook once; raise `NotifyFailed` if the call fails."""
        if self._options.command:
            _run(self._options, data)
        else:
            asyncio.run(_post(self._options, data))


def _run(options: NotifyOptions, data: bytes) -> None:
    try:
        # A new session, so that `killpg` also ends child processes.
        process = subprocess.Popen(  # noqa: S603 - the maintainer's own command, without a shell
            options.command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except (OSError, ValueError) as error:
        raise NotifyFailed(f"{options.place}: {error}") from None
    try:
        process.communicate(data, options.timeout_s)
    except subprocess.TimeoutExpired:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise NotifyFailed(
            f"{options.place}: did not finish within {options.timeout_s:g} s"
        ) from None
    if process.returncode:
        raise NotifyFailed(f"{options.place}: exit code {process.returncode}")


async def _post(options: NotifyOptions, data: bytes) -> None:
    headers = {"content-type": "application/json"}
    if options.secret:
        headers["authorization"] = f"Bearer {options.secret}"
    try:
        async with (
            asyncio.timeout(options.timeout_s),
            httpx2.AsyncClient(follow_redirects=False, trust_env=False) as client,
            client.stream("POST", options.url, headers=headers, content=data) as response,
        ):
            status = response.status_code
    except TimeoutError:
        raise NotifyFailed(f"{options.place}: no reply within {options.timeout_s:g} s") from None
    except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
        # The error text may contain the URL, and the URL may contain a secret.
        raise NotifyFailed(f"{options.place}: {type(error).__name__}") from None
    if not 200 <= status < 300:
        raise NotifyFailed(f"{options.place}: status {status}")


def _alarm(event: AlarmEvent, alarms: RobotAlarms) -> dict[str, Any]:
    declared = alarms.signals.get(event.signal)
    attributes = declared.limits.attributes_of(event.condition) if declared is not None else None
    return {
        "kind": event.kind,
        "signal": event.signal,
        "title": (declared.title if declared is not None else "") or spoken(event.signal),
        "condition": event.condition,
        "priority": event.priority,
        "value": event.value,
        "unit": declared.unit if declared is not None else "",
        "cause": attributes.cause if attributes is not None else "",
        "action": attributes.action if attributes is not None else "",
        "at": event.at,
    }
