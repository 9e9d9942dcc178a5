"""Answers to the services of rosapi over the Foxglove protocol.

Pure. A document that calls these services works over both bridges. The protocol itself has
parameters and a list of topics. rosapi passes the value of a parameter as JSON text.
"""

import json
from collections.abc import Mapping
from typing import Final, Protocol

__all__ = ["MAX_QUERIES", "RosapiAnswers", "RosapiCalls"]

MAX_QUERIES: Final = 256
"""Maximum number of pending queries for parameters; above the limit, the oldest is dropped."""
_PARAMETERS: Final = ("/rosapi/get_param", "/rosapi/set_param", "/rosapi/get_param_names")


class RosapiCalls(Protocol):
    """The parts of a session that the answers need."""

    capabilities: frozenset[str]

    def answer(self, number: object, reason: str = "", values: object = None) -> None:
        """Report the result of a request to the engine; a `reason` means failure."""

    def topics(self) -> dict[str, str]:
        """Return the types of all topics, keyed by topic."""

    def next_number(self) -> int:
        """Return a number that this connection has not used yet."""

    def operate(self, name: str, **fields: object) -> None:
        """Write an operation of the protocol."""


class RosapiAnswers:
    """The pending queries of one connection."""

    def __init__(self, calls: RosapiCalls) -> None:
        self._calls = calls
        self._asked: dict[str, tuple[object, str]] = {}
        """Request number and service of each pending parameter query, keyed by query id."""

    def answer(self, name: str, number: object, body: object) -> bool:
        """Answer a rosapi service through the protocol; return False for all other services."""
        fields = body if isinstance(body, Mapping) else {}
        if name == "/rosapi/topics":
            found = self._calls.topics()
            values = {"topics": list(found), "types": list(found.values())}
            self._calls.answer(number, values=values)
            return True
        if name not in _PARAMETERS:
            return False
        if "parameters" not in self._calls.capabilities:
            self._calls.answer(number, "the bridge has no parameters")
            return True
        query = str(self._calls.next_number())
        while len(self._asked) >= MAX_QUERIES:
            del self._asked[next(iter(self._asked))]
        self._asked[query] = (number, name)
        # rosapi writes /node:name, and the Foxglove bridge writes /node.name.
        parameter = str(fields.get("name") or "").replace(":", ".")
        if name == "/rosapi/set_param":
            one = {"name": parameter, "value": _of_text(fields.get("value"))}
            self._calls.operate("setParameters", parameters=[one], id=query)
        else:
            names = [parameter] if name == "/rosapi/get_param" else []
            self._calls.operate("getParameters", parameterNames=names, id=query)
        return True

    def found(self, query: str, values: Mapping[str, object]) -> None:
        """Answer the request of a query with the parameters that the bridge has sent."""
        number, service = self._asked.pop(query, (None, ""))
        if service == "/rosapi/get_param_names":
            self._calls.answer(number, values={"names": sorted(values)})
        elif service == "/rosapi/get_param":
            value = next(iter(values.values()), None)
            reason = "" if value is not None else "there is no such parameter"
            said = {"value": json.dumps(value), "successful": not reason}
            self._calls.answer(number, reason, said)
        elif service:
            self._calls.answer(number, values={"successful": True, "reason": ""})


def _of_text(value: object) -> object:
    """Decode a parameter's value, which rosapi passes as JSON text."""
    if not isinstance(value, str):
        return value
    try:
        return json.loads(value)
    except ValueError:
        return value
