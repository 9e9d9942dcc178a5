"""Encoder of a robot's alarms as messages for pages.

Layer 5. Pure.
"""

from collections.abc import Iterable, Mapping

from urc.alarms.record import AlarmRecord
from urc.model.values import Signal
from urc.web.wire.text import encoded, milliseconds
from urc.wire.server_messages import AlarmRow, AlarmsMessage

__all__ = ["alarm_row", "encode_alarms"]


def encode_alarms(
    records: Iterable[AlarmRecord],
    gone: Iterable[str],
    signals: Mapping[str, Signal],
    now: float,
    *,
    is_full: bool,
    is_flooded: bool,
) -> str:
    """Return a message with the changed alarms.

    Args:
        records: changed alarms.
        gone: signals whose alarms are no longer in the list.
        signals: the robot's signals, with causes and operator actions.
        now: UTC time in seconds since 1970.
        is_full: whether `records` contains all alarms.
        is_flooded: whether the robot currently has an alarm flood.
    """
    rows = [alarm_row(one, signals) for one in records]
    return encoded(
        AlarmsMessage(milliseconds(now), rows, tuple(gone), full=is_full, flood=is_flooded)
    )


def alarm_row(record: AlarmRecord, signals: Mapping[str, Signal]) -> AlarmRow:
    """Return one alarm with its cause and operator action."""
    signal = signals.get(record.signal, Signal(record.signal))
    attributes = signal.limits.attributes_of(record.condition)
    return AlarmRow(
        signal=record.signal,
        condition=record.condition,
        priority=record.priority,
        state=record.state,
        number=record.number,
        group=record.group,
        raised=record.raised,
        began=milliseconds(record.began_at),
        value=record.value,
        active=record.is_active,
        known=record.is_known,
        times=record.times,
        returned=milliseconds(record.returned_at),
        acknowledged=milliseconds(record.acknowledged_at),
        acknowledged_by=record.acknowledged_by,
        shelved_until=milliseconds(record.shelved_until),
        shelved_by=record.shelved_by,
        cause=attributes.cause,
        action=attributes.action,
        command=attributes.command,
        title=signal.title,
    )
