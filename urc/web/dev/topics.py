"""The table of a ROS robot's topics on the developer page.

Layer 5, pure. The names are from the robot, so each is escaped and shortened; the page shows them
as text.
"""

from collections.abc import Iterable, Mapping

import msgspec

from urc.runtime.topic_check import TopicUse
from urc.transports.ros.topic_list import TopicList, TopicRow
from urc.web.feed.topic_watch import TopicRates
from urc.web.wire.text import encoded
from urc.wire.server_messages import Outbound

__all__ = ["encode_topic_table"]


class _TableRow(msgspec.Struct, omit_defaults=True, frozen=True):
    name: str
    types: tuple[str, ...] = ()
    publishers: tuple[str, ...] | None = None
    """Nodes that publish the topic; None if unknown."""
    subscribers: tuple[str, ...] | None = None
    rate: float | None = None
    """Messages per second that URC receives; None for a topic without a subscription."""
    used: tuple[str, ...] = ()
    """The profile's signals and commands that use the topic."""
    is_used: bool = False


class _TopicTable(msgspec.Struct, frozen=True):
    transport: str
    total: int
    version: int | None
    known: bool
    rows: list[_TableRow]


class _Topics(Outbound, tag="topics", omit_defaults=False, frozen=True):
    tables: list[_TopicTable]


def encode_topic_table(
    lists: Mapping[str, TopicList], uses: Iterable[TopicUse], rates: TopicRates
) -> str:
    """Return the message with the topics of each transport, with used topics first.

    Args:
        lists: the topics of each transport, keyed by transport.
        uses: the topics that the profile uses.
        rates: the measured rates.
    """
    used: dict[tuple[str, str], dict[str, None]] = {}
    for one in uses:
        used.setdefault((one.transport, one.topic), {}).update(dict.fromkeys(one.names))
    tables = []
    for transport, listed in lists.items():
        rows = [_row(row, transport, used, rates) for row in listed.rows]
        rows.sort(key=lambda row: (not row.is_used, row.name))
        table = _TopicTable(transport, listed.total, listed.version, listed.is_known, rows)
        tables.append(table)
    return encoded(_Topics(tables))


def _row(
    row: TopicRow,
    transport: str,
    used: Mapping[tuple[str, str], Mapping[str, None]],
    rates: TopicRates,
) -> _TableRow:
    key = (transport, row.name)
    rate = rates.of(*key)
    return _TableRow(
        row.name,
        tuple(dict.fromkeys((*(row.carries or ()), *(row.takes or ())))),
        row.publishers,
        row.subscribers,
        None if rate is None else round(rate, 1),
        tuple(used.get(key, ())),
        key in used,
    )
