"""HTTP API endpoints for alarms: list, history, acknowledge, shelve, unshelve.

Layer 5. Reading requires the role ``watch``, and actions require ``drive``. No call of this API
opens a connection to a robot. The response to an action waits until the change is stored, so an
acknowledgement survives a server crash.
"""

import asyncio
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Final, get_args

from starlette.requests import Request
from starlette.responses import Response

from urc.alarms.alarm_list import AlarmActor
from urc.alarms.record import AlarmEventKind, AlarmRecord
from urc.model.values import Signal
from urc.runtime.alarm_store import AlarmStore
from urc.runtime.alarm_table import AlarmHistoryRow, AlarmQuery, AlarmSearchTimeout, search_alarms
from urc.runtime.server_recorder import ServerRecorder
from urc.web.alarms.counts import by_urgency, count_of
from urc.web.alarms.notifier import AlarmNotifier
from urc.web.alarms.wire import (
    AcknowledgeAsked,
    AlarmAction,
    AlarmHistory,
    AlarmHistoryEvent,
    AlarmInfo,
    AlarmOverview,
    NotificationCount,
    RobotAlarmList,
    ShelveAsked,
    UnshelveAsked,
)
from urc.web.audit.query import BadQuery, query_of
from urc.web.fleet.fleet import service_of
from urc.web.fleet.robots import RobotService
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, answers_errors, body_of
from urc.web.serve.rights import WATCH
from urc.web.serve.visitor import visitor_of
from urc.web.show.cells import spoken

__all__ = ["AlarmCalls", "alarm_key"]

STORED_S: Final = 2.0
"""Longest time that a response waits until its action is stored, in seconds."""
_SETTLE_S: Final = 0.5
_SEARCHES: Final = 2
"""Maximum number of concurrent searches; the limit leaves threads free for other work."""
_KINDS: Final = get_args(AlarmEventKind)


def alarm_key(name: str, *, is_emulated: bool) -> str:
    """Return a robot's name in the store; emulated and real robots have separate entries."""
    return f"emulated:{name}" if is_emulated else name


class AlarmCalls:
    """The alarm endpoints."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        store: AlarmStore | None,
        recorder: ServerRecorder,
        notifier: AlarmNotifier | None = None,
    ) -> None:
        """Create the endpoints.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            store: the alarm store; None if the server has no data folder.
            recorder: receives an audit entry for each action.
            notifier: sender of alarm notifications; None if the server has no hook.
        """
        self._services = services
        self._store = store
        self._recorder = recorder
        self._notifier = notifier
        self._searching = asyncio.Semaphore(_SEARCHES)

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the alarm endpoints, keyed by the name of their API call."""
        return {
            "alarms_overview": self.overview,
            "alarms": self.alarms,
            "alarm_history": self.history,
            "alarms_acknowledge": self.acknowledge,
            "alarms_shelve": self.shelve,
            "alarms_unshelve": self.unshelve,
        }

    # Reading

    async def overview(self, request: Request) -> Response:
        """Return the alarm counts of all robots that the visitor may watch."""
        visitor = visitor_of(request)
        counts = (
            count_of(name, one.alarms.list.records.values(), is_monitored=one.is_monitored)
            for name, one in self._services().items()
            if visitor.may(WATCH, name)
        )
        told = None if self._notifier is None else NotificationCount(*self._notifier.count)
        return answer(AlarmOverview(tuple(counts), told))

    @answers_errors
    async def alarms(self, request: Request) -> Response:
        """Return a robot's alarms outside the normal state."""
        name, service = service_of(self._services(), request)
        alarms = service.alarms
        records = sorted(alarms.list.records.values(), key=by_urgency)
        signals = alarms.signals
        infos = tuple(_info(one, signals) for one in records)
        count = count_of(name, records, is_monitored=service.is_monitored)
        return answer(RobotAlarmList(time.time(), alarms.list.is_flooded, count, infos))

    @answers_errors
    async def history(self, request: Request) -> Response:
        """Return the latest events of a robot's alarms, newest first."""
        _, service = service_of(self._services(), request)
        if self._store is None or service.robot.playback is not None:
            return answer(AlarmHistory((), has_more=False, fault="", lost=0))
        signals = service.alarms.signals
        query = _query(request, service, signals)
        try:
            async with self._searching:
                rows = await asyncio.to_thread(_found, self._store, query)
        except (AlarmSearchTimeout, OSError) as error:
            raise ApiError(503, str(error)) from None
        return answer(
            AlarmHistory(
                tuple(_event(row, signals) for row in rows),
                has_more=len(rows) == query.last,
                fault=self._store.fault,
                lost=self._store.lost,
            )
        )

    # Acting

    @answers_errors
    async def acknowledge(self, request: Request) -> Response:
        """Acknowledge alarms."""
        name, service = self._acting(request)
        asked = await body_of(request, AcknowledgeAsked)
        done = service.alarms.acknowledge(asked.alarms, self._actor(request))
        return await self._done(request, name, "acknowledged", done)

    @answers_errors
    async def shelve(self, request: Request) -> Response:
        """Shelve alarms for a limited time."""
        name, service = self._acting(request)
        asked = await body_of(request, ShelveAsked)
        done = service.alarms.shelve(asked.signals, asked.for_s, self._actor(request))
        return await self._done(request, name, "shelved", done, for_s=asked.for_s)

    @answers_errors
    async def unshelve(self, request: Request) -> Response:
        """Unshelve alarms."""
        name, service = self._acting(request)
        asked = await body_of(request, UnshelveAsked)
        done = service.alarms.unshelve(asked.signals, self._actor(request))
        return await self._done(request, name, "unshelved", done)

    # Inside

    def _acting(self, request: Request) -> tuple[str, RobotService]:
        name, service = service_of(self._services(), request)
        if service.robot.playback is not None:
            raise ApiError(409, "the alarms of a playback cannot be changed", "recorded")
        if not visitor_of(request).may_give(""):
            raise ApiError(403, "this token is limited to certain commands", "forbidden")
        return name, service

    def _actor(self, request: Request) -> AlarmActor:
        actor = actor_of(request)
        return AlarmActor(actor.name or "this machine", actor.principal)

    async def _done(
        self,
        request: Request,
        name: str,
        step: str,
        done: Iterable[AlarmRecord],
        **about: object,
    ) -> Response:
        signals = tuple(one.signal for one in done)
        if signals:
            self._recorder.alarm(actor_of(request, name), name, step, signals, **about)
        # The change is already in effect; if it is not stored, a restart may lose it.
        is_stored = self._store is not None and await asyncio.to_thread(
            self._store.settle, STORED_S
        )
        return answer(AlarmAction(signals, stored=is_stored))


def _query(request: Request, service: RobotService, signals: Mapping[str, Signal]) -> AlarmQuery:
    """Return the alarm query of a request; raise `ApiError` 400 for an invalid value."""
    given = request.query_params
    try:
        asked = query_of({**given, "what": given.get("kinds", "")}, None)
    except BadQuery as error:
        raise ApiError(400, str(error).replace("'what'", "'kinds'")) from None
    for kind in asked.what:
        if kind not in _KINDS:
            raise ApiError(400, f"unknown event kind {kind!r}; known kinds: {', '.join(_KINDS)}")
    text = asked.text.casefold()
    titled = [name for name, one in signals.items() if text and text in _title(one).casefold()]
    return AlarmQuery(
        robot=service.alarms.key,
        text=asked.text,
        kinds=asked.what,
        signals=tuple(titled),
        since=asked.since,
        until=asked.until,
        before=asked.before,
        last=asked.last,
    )


def _found(store: AlarmStore, query: AlarmQuery) -> list[AlarmHistoryRow]:
    store.settle(_SETTLE_S)  # the newest events matter most
    return search_alarms(store.file, query)


def _title(signal: Signal) -> str:
    return signal.title or spoken(signal.name)


def _info(record: AlarmRecord, signals: Mapping[str, Signal]) -> AlarmInfo:
    signal = signals.get(record.signal, Signal(record.signal))
    attributes = signal.limits.attributes_of(record.condition)
    return AlarmInfo(
        signal=record.signal,
        title=_title(signal),
        condition=record.condition,
        priority=record.priority,
        state=record.state,
        active=record.is_active,
        known=record.is_known,
        value=record.value,
        unit=signal.unit,
        cause=attributes.cause,
        action=attributes.action,
        command=attributes.command,
        number=record.number,
        group=record.group,
        raised=record.raised,
        times=record.times,
        began_at=record.began_at,
        returned_at=record.returned_at,
        acknowledged_at=record.acknowledged_at,
        acknowledged_by=record.acknowledged_by,
        shelved_until=record.shelved_until,
        shelved_by=record.shelved_by,
    )


def _event(row: AlarmHistoryRow, signals: Mapping[str, Signal]) -> AlarmHistoryEvent:
    event = row.event
    return AlarmHistoryEvent(
        id=row.id,
        at=event.at,
        signal=event.signal,
        title=_title(signals.get(event.signal, Signal(event.signal))) if event.signal else "",
        kind=event.kind,
        condition=event.condition,
        priority=event.priority,
        value=event.value,
        state=event.state,
        who=event.who,
        until=event.until,
        times=event.times,
    )
