"""The topics of a robot behind a rosbridge server, as the node rosapi reports them.

rosapi lists all topics with their types in one reply, but reports publishers and subscribers only
for one topic per call. The calls are made one after another. They end as soon as URC publishes a
message, because some bridges handle a call before all later messages.
"""

from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final

from urc.model.payload import Envelope
from urc.transports.ros.graph import version_of
from urc.transports.ros.topic_list import MAX_TOPICS, TopicRow, answer_of, wanted_of

__all__ = ["RosapiTopics"]

MAX_ASKED: Final = 100
"""Maximum number of topics whose publishers and subscribers are requested at once."""
_MANY: Final = 5000
"""Number of topics above which the list is not requested again on the same connection."""

Ask = Callable[[str, Mapping[str, object]], Awaitable[Mapping[str, Any] | None]]
"""Function that calls a service and returns its reply; None after an error or without a reply."""


class RosapiTopics:
    """The topics of one connection."""

    def __init__(self, ask: Ask, is_quiet: Callable[[], bool]) -> None:
        """Store the functions; `is_quiet` returns whether nothing is being published."""
        self._ask = ask
        self._is_quiet = is_quiet
        self._types: dict[str, str] = {}
        self._is_listed = False

    def learn(self, types: Mapping[str, str]) -> None:
        """Store the topics and their types from another call of rosapi."""
        self._types, self._is_listed = dict(types), True

    async def answer(self, request: Envelope, received: Mapping[str, int]) -> Envelope | None:
        """Return the answer to a request; None if a message was published meanwhile.

        Args:
            request: the request for topics.
            received: number of received messages, keyed by subscribed topic.
        """
        names, is_all = wanted_of(request)
        if not (self._is_listed and len(self._types) > _MANY):
            said = await self._ask("/rosapi/topics", {})
            if said is None:
                return answer_of((), 0, None, is_known=False, is_all=is_all)
            self._learn(said)
        rows = []
        others = sorted(self._types.keys() - set(names)) if is_all else []
        for place, name in enumerate((*names, *others[:MAX_TOPICS])):
            row = self._row(name, received)
            if place < MAX_ASKED:
                if not self._is_quiet():
                    return None
                row = row._replace(
                    publishers=await self._nodes("publishers", name),
                    subscribers=await self._nodes("subscribers", name),
                )
            rows.append(row)
        version = version_of(self._types.values())
        return answer_of(rows, len(self._types), version, is_all=is_all)

    def _learn(self, said: Mapping[str, Any]) -> None:
        names, types = said.get("topics"), said.get("types")
        if isinstance(names, list):
            kinds = types if isinstance(types, list) and len(types) == len(names) else []
            found = dict(zip(names, kinds or [""] * len(names), strict=True))
            self.learn({str(name): str(kind) for name, kind in found.items()})

    def _row(self, name: str, received: Mapping[str, int]) -> TopicRow:
        kind = self._types.get(name, "")
        types = (kind,) if kind else None  # rosapi does not tell who uses which type
        return TopicRow(name, types, types, received=received.get(name))

    async def _nodes(self, which: str, name: str) -> tuple[str, ...] | None:
        said = await self._ask(f"/rosapi/{which}", {"topic": name})
        found = said.get(which) if said is not None else None
        return tuple(map(str, found)) if isinstance(found, list) else None
