"""JSON messages of the HTTP API for alarms; the keys are in snake case.

Layer 5. Pure. Times are in seconds since 1970 (UTC); 0 means that no time is set.
"""

from typing import Annotated, Final

import msgspec

from urc.alarms.alarm_list import LONGEST_SHELF_S
from urc.alarms.record import AlarmEventKind, AlarmState
from urc.model.values import AlarmPriority

__all__ = [
    "AcknowledgeAsked",
    "AlarmAction",
    "AlarmCount",
    "AlarmHistory",
    "AlarmHistoryEvent",
    "AlarmInfo",
    "AlarmOverview",
    "NotificationCount",
    "RobotAlarmList",
    "ShelveAsked",
    "UnshelveAsked",
]

_Word = Annotated[str, msgspec.Meta(max_length=200)]
_MOST: Final = 2000
_Signals = Annotated[tuple[_Word, ...], msgspec.Meta(min_length=1, max_length=_MOST)]
_Number = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class AlarmMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of all messages in this module."""


class AlarmInfo(AlarmMessage, frozen=True):
    """One alarm outside the normal state."""

    signal: str
    title: str
    """Title of the signal."""
    condition: str
    """Exceeded limit (``lolo``, ``low``, ``high``, ``hihi``), or alarm state of the signal."""
    priority: AlarmPriority
    state: AlarmState
    active: bool
    """Whether the value is abnormal; if unknown, whether the last known value was abnormal."""
    known: bool
    """Whether the current value is known."""
    value: str
    """Value of the signal at the alarm's last change, as text."""
    unit: str
    cause: str
    """Probable cause of the alarm, from the robot's document."""
    action: str
    """Operator action."""
    command: str
    """Command that carries out the action; "" if the robot's document names none."""
    number: int
    """Number of the activation; numbers increase in first-out order."""
    group: int
    """Number of the burst to which the alarm belongs."""
    raised: int
    """Number assigned when the alarm was last raised; an acknowledgement must repeat the number."""
    times: int
    """Number of activations since the alarm was last normal."""
    began_at: float
    """Time of the activation, in seconds since 1970 (UTC)."""
    returned_at: float
    """Time of the return to normal, in seconds since 1970 (UTC); 0 while active."""
    acknowledged_at: float
    """Time of the acknowledgement, in seconds since 1970 (UTC); 0 if unacknowledged."""
    acknowledged_by: str
    """Name of the person or program that acknowledged the alarm; "" if unacknowledged."""
    shelved_until: float
    """Time at which shelving ends, in seconds since 1970 (UTC); 0 if unshelved."""
    shelved_by: str
    """Name of the person or program that shelved the alarm; "" if unshelved."""


class AlarmCount(AlarmMessage, frozen=True):
    """The alarm counts of a robot."""

    robot: str
    active: int
    """Number of active alarms, excluding shelved and suppressed alarms."""
    unacknowledged: int
    """Number of annunciated alarms that are not acknowledged."""
    worst: str
    """Highest priority of the annunciated alarms; "" if there are no such alarms."""
    known: bool
    """Whether all annunciated alarms have known values."""
    monitored: bool
    """Whether the robot stays connected so that its alarms are monitored."""


class NotificationCount(AlarmMessage, frozen=True):
    """Counts of notifications since the server started."""

    sent: int
    """Number of notifications sent."""
    failed: int
    """Number of notifications for which every attempt failed."""
    lost: int
    """Number of alarms dropped because the queue was full."""


class AlarmOverview(AlarmMessage, frozen=True):
    """The alarm counts of all robots that the visitor may watch."""

    robots: tuple[AlarmCount, ...]
    notifications: NotificationCount | None
    """Counts of notifications; null if the server sends no notifications."""


class RobotAlarmList(AlarmMessage, frozen=True):
    """A robot's alarms outside the normal state, most urgent first."""

    time: float
    """Current time of the server's clock, in seconds since 1970 (UTC)."""
    flood: bool
    """Whether more than 10 alarms were raised within 10 minutes."""
    count: AlarmCount
    alarms: tuple[AlarmInfo, ...]


class AlarmHistoryEvent(AlarmMessage, frozen=True):
    """One event of the alarm history."""

    id: int
    """Number of the event; newer events have higher numbers."""
    at: float
    """Time of the event, in seconds since 1970 (UTC)."""
    signal: str
    """Name of the signal; "" for a flood."""
    title: str
    kind: AlarmEventKind
    condition: str
    priority: str
    value: str
    """Value at the time of the event, as text."""
    state: str
    """State of the alarm after the event."""
    who: str
    """Name of the person or program that acted; "" for events from the robot."""
    until: float
    """Time at which shelving ends, in seconds since 1970 (UTC); 0 if the alarm is not shelved."""
    times: int


class AlarmHistory(AlarmMessage, frozen=True):
    """Events of a robot's alarms, newest first."""

    events: tuple[AlarmHistoryEvent, ...]
    has_more: bool
    """Whether the history may contain older matching events."""
    fault: str
    """Reason why events currently cannot be stored; "" if they can be stored."""
    lost: int
    """Number of events that could not be stored since the server started."""


class AcknowledgeAsked(AlarmMessage, frozen=True):
    """Request to acknowledge alarms in the state that the operator saw."""

    alarms: Annotated[dict[_Word, _Number], msgspec.Meta(min_length=1, max_length=_MOST)]
    """Value of `raised` that the operator saw, keyed by signal. An alarm that has been raised again
    is skipped."""


class ShelveAsked(AlarmMessage, frozen=True):
    """Request to shelve alarms for a limited time."""

    signals: _Signals
    for_s: Annotated[float, msgspec.Meta(ge=1, le=LONGEST_SHELF_S)]
    """Time from now until shelving ends, in seconds."""


class UnshelveAsked(AlarmMessage, frozen=True):
    """Request to unshelve alarms."""

    signals: _Signals


class AlarmAction(AlarmMessage, frozen=True):
    """Result of a request to acknowledge, shelve or unshelve alarms."""

    signals: tuple[str, ...]
    """Names of the signals whose alarms the request changed."""
    stored: bool
    """Whether the change is stored and survives a restart."""
