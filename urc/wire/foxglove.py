"""The messages of URC's Foxglove server, in the Foxglove WebSocket protocol, version 1.

Layer 3½. Pure. A text message is a JSON object with the key ``op``. The first byte of a binary
message is its kind, and all numbers are little-endian. Source: foxglove/ws-protocol, docs/spec.md.
The subprotocol ``foxglove.sdk.v1`` has the same messages.

Messages from the server::

    serverInfo          once, first: name, capabilities and session id
    advertise           new channels; ``unadvertise`` ends them
    advertiseServices   new services; ``unadvertiseServices`` ends them
    status              a warning or an error, which ``removeStatus`` withdraws
    serviceCallFailure  the reason why a call failed
    1 (binary)          a message of a subscribed channel
    3 (binary)          the response to a call

Messages from the client are ``subscribe``, ``unsubscribe`` and the binary message 2, a call.
Clients cannot publish, because the protocol cannot tell the robot that a client has released a
control.
"""

import struct
from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal, NamedTuple

import msgspec

from urc.transports.ros.foxglove_frames import SUBPROTOCOLS

__all__ = [
    "CAPABILITIES",
    "ENCODING",
    "PATH",
    "SUBPROTOCOLS",
    "BadClientMessage",
    "ClientFrame",
    "Level",
    "OfferedChannel",
    "OfferedService",
    "ServiceCall",
    "Subscribe",
    "Unsubscribe",
    "chosen_subprotocol",
    "decode",
    "encode_advertise",
    "encode_failure",
    "encode_message_head",
    "encode_response",
    "encode_server_info",
    "encode_services",
    "encode_status",
    "encode_status_end",
    "encode_unadvertise",
    "encode_unadvertise_services",
]

PATH: Final = "/api/v1/foxglove"
"""Path of the Foxglove server on the dashboard's port."""
CAPABILITIES: Final = ("services",)
ENCODING: Final = "json"
"""Encoding of the messages of all channels and services."""
_SCHEMA_ENCODING: Final = "jsonschema"
_MESSAGE_HEAD: Final = struct.Struct("<BIQ")
_CALL_HEAD: Final = struct.Struct("<BIII")
_MESSAGE, _CALL, _RESPONSE = 1, 2, 3
_LONGEST_ENCODING: Final = 64
"""Maximum length of the name of a call's encoding, in bytes."""
_LEVELS: Final = {"info": 0, "warning": 1, "error": 2}
_LONGEST: Final = 500
"""Maximum length of the text that gives a reason, in characters."""
_NOT_OFFERED: Final = frozenset(
    {
        *("advertise", "unadvertise", "getParameters", "setParameters", "fetchAsset"),
        *("subscribeParameterUpdates", "unsubscribeParameterUpdates"),
        *("subscribeConnectionGraph", "unsubscribeConnectionGraph", "playbackControlRequest"),
    }
)
"""Operations of the protocol that this server does not offer."""
Level = Literal["info", "warning", "error"]
"""Severity of a status message."""
_Id = Annotated[int, msgspec.Meta(ge=0, lt=2**32)]


class BadClientMessage(Exception):
    """An invalid message from the client, as one line of text."""


class OfferedChannel(NamedTuple):
    """A topic that the server offers."""

    id: int
    topic: str
    schema_name: str
    schema: str
    """JSON Schema of the topic's messages, as JSON text."""


class OfferedService(NamedTuple):
    """A service that the server offers; the schemas are JSON text."""

    id: int
    name: str
    type: str
    request: str
    response: str


class Subscription(msgspec.Struct, frozen=True):
    """One requested channel; the client chooses `id`."""

    id: _Id
    channel: _Id = msgspec.field(name="channelId")


class Subscribe(msgspec.Struct, tag_field="op", tag="subscribe", frozen=True):
    """A request to subscribe to channels."""

    subscriptions: tuple[Subscription, ...]


class Unsubscribe(msgspec.Struct, tag_field="op", tag="unsubscribe", frozen=True):
    """A request to end subscriptions."""

    ids: tuple[_Id, ...] = msgspec.field(name="subscriptionIds")


class ServiceCall(NamedTuple):
    """A service call; the client chooses the number `call`."""

    service: int
    call: int
    encoding: str
    data: bytes


ClientFrame = Subscribe | Unsubscribe | ServiceCall

_operations: Final[msgspec.json.Decoder[Subscribe | Unsubscribe]] = msgspec.json.Decoder(
    Subscribe | Unsubscribe
)
_any: Final = msgspec.json.Decoder(dict[str, object])


def chosen_subprotocol(offered: Iterable[str]) -> str | None:
    """Return the first subprotocol in the client's offer that the server supports, or None."""
    return next((one for one in offered if one in SUBPROTOCOLS), None)


# ---- from the client


def decode(message: str | bytes) -> ClientFrame:
    """Return a message from the client: text, or bytes for a binary message.

    Raises:
        BadClientMessage: the message is invalid, or requires a capability that the server lacks.
    """
    return _operation(message) if isinstance(message, str) else _binary(message)


def _operation(text: str) -> ClientFrame:
    try:
        return _operations.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        op = _op(text)
        if op in _NOT_OFFERED:
            raise BadClientMessage(f"this server does not offer {op!r}") from None
        raise BadClientMessage(
            f"expected 'subscribe' or 'unsubscribe': {error}"[:_LONGEST]
        ) from None


def _op(text: str) -> str:
    try:
        op = _any.decode(text).get("op")
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return ""
    return op if isinstance(op, str) else ""


def _binary(data: bytes) -> ServiceCall:
    if not data or data[0] != _CALL:
        found = f"kind {data[0]}" if data else "no bytes"
        raise BadClientMessage(f"expected a binary message of kind {_CALL}, found {found}")
    if len(data) < _CALL_HEAD.size:
        needed = _CALL_HEAD.size
        raise BadClientMessage(f"a service call has at least {needed} bytes, found {len(data)}")
    _, service, call, length = _CALL_HEAD.unpack_from(data)
    start = _CALL_HEAD.size + length
    if length > _LONGEST_ENCODING or start > len(data):
        raise BadClientMessage(f"the encoding of a service call cannot have {length} bytes")
    encoding = data[_CALL_HEAD.size : start].decode("ascii", "replace")
    return ServiceCall(service, call, encoding, data[start:])


# ---- from the server


def encode_server_info(name: str, version: str, session: str) -> bytes:
    """Return the server's first message; `session` differs after each start of the server."""
    return _told(
        "serverInfo",
        name=name,
        capabilities=CAPABILITIES,
        supportedEncodings=(ENCODING,),
        metadata={"urc": version},
        sessionId=session,
    )


def encode_advertise(channels: Iterable[OfferedChannel]) -> bytes:
    """Return the message that announces channels."""
    return _told(
        "advertise",
        channels=[
            {
                "id": one.id,
                "topic": one.topic,
                "encoding": ENCODING,
                "schemaName": one.schema_name,
                "schemaEncoding": _SCHEMA_ENCODING,
                "schema": one.schema,
            }
            for one in channels
        ],
    )


def encode_unadvertise(channels: Iterable[int]) -> bytes:
    """Return the message that withdraws channels."""
    return _told("unadvertise", channelIds=list(channels))


def encode_services(services: Iterable[OfferedService]) -> bytes:
    """Return the message that announces services."""
    return _told(
        "advertiseServices",
        services=[
            {
                "id": one.id,
                "name": one.name,
                "type": one.type,
                "request": _side(f"{one.type}.Request", one.request),
                "response": _side(f"{one.type}.Response", one.response),
            }
            for one in services
        ],
    )


def encode_unadvertise_services(services: Iterable[int]) -> bytes:
    """Return the message that withdraws services."""
    return _told("unadvertiseServices", serviceIds=list(services))


def encode_status(level: Level, message: str, status: str = "") -> bytes:
    """Return a status message, which replaces any earlier status with the same id `status`."""
    more = {"id": status} if status else {}
    return _told("status", level=_LEVELS[level], message=message[:_LONGEST], **more)


def encode_status_end(statuses: Iterable[str]) -> bytes:
    """Return the message that removes the statuses with the given ids."""
    return _told("removeStatus", statusIds=list(statuses))


def encode_failure(service: int, call: int, message: str) -> bytes:
    """Return the message that reports a failed call."""
    return _told("serviceCallFailure", serviceId=service, callId=call, message=message[:_LONGEST])


def encode_response(service: int, call: int, data: bytes) -> bytes:
    """Return the binary response to a call; `data` is JSON text."""
    name = ENCODING.encode()
    return _CALL_HEAD.pack(_RESPONSE, service, call, len(name)) + name + data


def encode_message_head(subscription: int, time_ns: int) -> bytes:
    """Return the first bytes of a binary message; the message's JSON text follows.

    Args:
        subscription: the client's id of the subscription.
        time_ns: receive time, in nanoseconds since 1970.
    """
    return _MESSAGE_HEAD.pack(_MESSAGE, subscription, time_ns)


def _side(name: str, schema: str) -> Mapping[str, str]:
    return {
        "encoding": ENCODING,
        "schemaName": name,
        "schemaEncoding": _SCHEMA_ENCODING,
        "schema": schema,
    }


def _told(op: str, **more: object) -> bytes:
    return msgspec.json.encode({"op": op, **more})
