"""JSON messages of the HTTP API about alarms, in snake case.

Layer 5. Pure. Times are in UTC seconds since 1970; 0 stands for no time.
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
    """The base class of all messages in this module."""


class AlarmInfo(AlarmMessage, frozen=True):
    """One alarm that is not normal."""

    signal: str
    title: str
    """Title of the signal."""
    condition: str
    """Crossed limit (``lolo``, ``low``, ``high``, ``hihi``), or alarm state."""
    priority: AlarmPriority
    state: AlarmState
    active: bool
    """Whether the value is abnormal; if it is unknown, whether it was abnormal at last."""
    known: bool
    """Whether the present value is known."""
    value: str
    """Value at the last change, as text."""
    unit: str
    cause: str
    action: str
    """Operator action."""
    number: int
    """Number of the activation; the order of the numbers is first-out."""
    group: int
    """Number of the burst of alarms."""
    raised: int
    """Number that an acknowledgement must repeat."""
    times: int
    """Number of activations since the alarm was last normal."""
    began_at: float
    returned_at: float
    acknowledged_at: float
    acknowledged_by: str
    shelved_until: float
    shelved_by: str


class AlarmCount(AlarmMessage, frozen=True):
    """The number of a robot's alarms."""

    robot: str
    active: int
    """Number of active alarms that are neither shelved nor suppressed."""
    unacknowledged: int
    """Number of alarms that wait for an acknowledgement."""
    worst: str
    """Highest priority of these alarms; "" without alarms."""
    known: bool
    """Whether the values of all these alarms are known."""
    monitored: bool
    """Whether the robot stays connected for its alarms."""


class NotificationCount(AlarmMessage, frozen=True):
    """The numbers of notifications since the start of the server."""

    sent: int
    failed: int
    """Number of notifications that failed in all attempts."""
    lost: int
    """Number of alarms that were not notified, because too many waited."""


class AlarmOverview(AlarmMessage, frozen=True):
    """The numbers of alarms of all robots that the visitor may watch."""

    robots: tuple[AlarmCount, ...]
    notifications: NotificationCount | None
    """Numbers of notifications; null for a server without notifications."""


class RobotAlarmList(AlarmMessage, frozen=True):
    """All alarms of a robot that are not normal, the most urgent first."""

    time: float
    """Time of the server."""
    flood: bool
    """Whether more than 10 alarms have come in 10 minutes."""
    count: AlarmCount
    alarms: tuple[AlarmInfo, ...]


class AlarmHistoryEvent(AlarmMessage, frozen=True):
    """One event of the history."""

    id: int
    at: float
    signal: str
    """Name of the signal; "" for a flood."""
    title: str
    kind: AlarmEventKind
    condition: str
    priority: str
    value: str
    state: str
    """State of the alarm after the event."""
    who: str
    """Name of the person or program that acted; "" for an event of the robot."""
    until: float
    """End of a shelf."""
    times: int


class AlarmHistory(AlarmMessage, frozen=True):
    """Events of a robot's alarms, newest first."""

    events: tuple[AlarmHistoryEvent, ...]
    has_more: bool
    """Whether older events may match, too."""
    fault: str
    """Reason why events currently cannot be stored, or ""."""
    lost: int
    """Number of events since the start of the server that could not be stored."""


class AcknowledgeAsked(AlarmMessage, frozen=True):
    """Request to acknowledge alarms as the operator saw them."""

    alarms: Annotated[dict[_Word, _Number], msgspec.Meta(min_length=1, max_length=_MOST)]
    """Number `raised` of each alarm, by signal; alarms that were raised again are left out."""


class ShelveAsked(AlarmMessage, frozen=True):
    """Request to shelve alarms until an end."""

    signals: _Signals
    for_s: Annotated[float, msgspec.Meta(ge=1, le=LONGEST_SHELF_S)]


class UnshelveAsked(AlarmMessage, frozen=True):
    """Request to end the shelves of alarms."""

    signals: _Signals


class AlarmAction(AlarmMessage, frozen=True):
    """Result of a request about alarms."""

    signals: tuple[str, ...]
    """Signals whose alarm has changed."""
    stored: bool
    """Whether the change is stored, so that it survives a restart."""
