"""The alarm counts of a robot, for its card and for the API's overview.

Layer 5. Pure.
"""

from collections.abc import Iterable

from urc.alarms.record import AlarmRecord, severity
from urc.web.alarms.wire import AlarmCount

__all__ = ["by_urgency", "count_of"]


def count_of(
    robot: str, records: Iterable[AlarmRecord], *, is_monitored: bool = False
) -> AlarmCount:
    """Return the counts of a robot's annunciated alarms.

    Args:
        robot: the robot's name in URLs.
        records: all alarms outside the normal state.
        is_monitored: whether the robot stays connected so that its alarms are monitored.
    """
    shown = [one for one in records if one.is_annunciated]
    worst = min((severity(one.condition, one.priority) for one in shown), default=None)
    priorities = {severity(one.condition, one.priority): one.priority for one in shown}
    return AlarmCount(
        robot=robot,
        active=sum(one.is_active for one in shown),
        unacknowledged=sum(not one.is_acknowledged for one in shown),
        worst="" if worst is None else priorities[worst],
        known=all(one.is_known for one in shown),
        monitored=is_monitored,
    )


def by_urgency(record: AlarmRecord) -> tuple[object, ...]:
    """Return a sort key: annunciated, active, unacknowledged and severe alarms come first."""
    hidden = not record.is_annunciated
    order = severity(record.condition, record.priority)
    return (hidden, not record.is_active, record.is_acknowledged, order, record.number)
