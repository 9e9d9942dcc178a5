"""The topics of a ROS 2 system on Zenoh, from the tokens of its publishers and subscriptions.

Each token names the node, the topic and the type, so the types of publishers and of subscriptions
are known separately. No I/O.
"""

from collections.abc import Iterable, Mapping

from urc.model.payload import Envelope
from urc.transports.ros.topic_list import MAX_TOPICS, TopicRow, answer_of, wanted_of
from urc.transports.ros.zenoh_names import TopicToken

__all__ = ["answer_from"]

ROS_VERSION = 2


def answer_from(
    tokens: Iterable[TopicToken], request: Envelope, received: Mapping[str, int]
) -> Envelope:
    """Return the answer to a request for topics.

    Args:
        tokens: the tokens of the robot, without URC's own.
        request: the request.
        received: number of received messages, keyed by subscribed topic with a leading slash.
    """
    names, is_all = wanted_of(request)
    topics: dict[str, list[TopicToken]] = {}
    for one in tokens:
        topics.setdefault(one.topic, []).append(one)
    others = sorted(topics.keys() - {*names})[:MAX_TOPICS] if is_all else []
    rows = []
    for name in (*names, *others):
        full = f"/{name.strip('/')}"
        found = topics.get(full, ())
        out = [one for one in found if one.kind == "publisher"]
        into = [one for one in found if one.kind == "subscription"]
        rows.append(
            TopicRow(
                name,
                _sorted(one.type for one in out) or None,
                _sorted(one.type for one in into) or None,
                _sorted(one.node for one in out),
                _sorted(one.node for one in into),
                received.get(full),
            )
        )
    return answer_of(rows, len(topics), ROS_VERSION, is_all=is_all)


def _sorted(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({*names}))
