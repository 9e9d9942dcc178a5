"""A survey of one ROS robot without a profile: its kind of connection and its topics.

Layer 4. The survey opens a connection, requests the topics until the list is complete, and closes
the connection. It subscribes to nothing and publishes nothing.
"""

import asyncio
from typing import Final, NamedTuple

from urc.model.payload import Envelope
from urc.problems import UrcError
from urc.registry import Table
from urc.transports.base import TOPICS, Transport, TransportError, TransportSetup
from urc.transports.ros.choice import PORTS, AnyBridgeTransport
from urc.transports.ros.topic_list import TopicList, list_of, request_for

__all__ = ["RosSurvey", "list_topics", "survey"]

OPEN_S: Final = 4.0
"""Maximum time for opening each kind of connection, in seconds."""
LIST_S: Final = 8.0
"""Maximum time for listing the topics, in seconds."""
_AGAIN_S: Final = 0.5
"""Interval between two requests, in seconds; ROS announces topics gradually."""


class RosSurvey(NamedTuple):
    """The result of a survey."""

    via: str
    """Kind of the connection: ``rosbridge``, ``foxglove`` or ``zenoh``."""
    port: int
    topics: TopicList


async def survey(table: Table, host: str, port: int | None) -> RosSurvey:
    """Return the topics of the robot at `host`, from the first kind of connection that works.

    Args:
        table: the table of transport types.
        host: host name or address.
        port: port of the bridge or router; None to try the usual ports.

    Raises:
        UrcError: nothing answers, or the topics cannot be listed.
    """
    make = table["ros"].load()
    faults = []
    for via in ("auto", "zenoh"):
        number = port if via == "auto" else port or PORTS["zenoh"][0]
        options: dict[str, object] = {"via": via, "host": host, "port": number, "version": "auto"}
        try:
            transport = make(TransportSetup("ros", options))
        except TransportError as fault:  # such as a missing extra
            faults.append(str(fault))
            continue
        try:
            await transport.open(OPEN_S)
            found = await list_topics(transport)
        except TransportError as fault:
            faults.append(str(fault))
            continue
        finally:
            await transport.close()
        if isinstance(transport, AnyBridgeTransport):
            return RosSurvey(*transport.chosen, found)
        return RosSurvey(via, PORTS["zenoh"][0] if port is None else port, found)
    raise UrcError("; ".join(faults))


async def list_topics(transport: Transport) -> TopicList:
    """Return the topics of the robot behind an open ROS transport.

    The list is complete when two successive lists have equally many topics.

    Raises:
        TransportError: the connection cannot list topics, or lists none.
    """
    last: TopicList | None = None
    try:
        async with asyncio.timeout(LIST_S):
            while True:
                await asyncio.sleep(_AGAIN_S)
                await transport.send(request_for((), is_all=True))
                found = await _answer(transport)
                if not found.is_known:
                    text = f"{transport.address} cannot list topics: start rosapi on the robot"
                    raise TransportError(text)
                if last is not None and found.rows and last.total == found.total:
                    return found
                last = found
    except TimeoutError:
        if last is not None and last.rows:
            return last
        raise TransportError(f"{transport.address} has listed no topics") from None


async def _answer(transport: Transport) -> TopicList:
    while True:
        said = await transport.receive()
        if isinstance(said, Envelope) and said.verb == TOPICS:
            return list_of(said)
