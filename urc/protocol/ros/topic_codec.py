"""Conversion of ROS messages between their binary forms and plain data, for one connection.

Pure. With the Foxglove protocol, the transport carries messages as bytes. The transport delivers
the definition of a topic's type before the topic's messages, in an envelope with the verb
`DEFINITION`. With this definition, the codec reads only those parts of each message that the driver
uses. The transport never decodes messages. If the robot can be driven, the transport runs in the
guard, which must not be delayed.

When a message is sent, the codec adds the message's bytes to its envelope. The definition of a
published type comes from `urc.protocol.ros.common_types`, or from a topic of the same type. If
there is no definition, the envelope has no bytes, and the transport sends JSON. The envelope always
keeps its plain body, so it also works with rosbridge.

Over Zenoh, a robot sends the hash of each type instead of its definition. The codec then uses its
own definition (`urc.protocol.ros.known_types`) if the hash is the same.

The goals of actions are calls of hidden services (`urc.transports.ros.foxglove_actions`). A goal
that was sent before STOP is not encoded any more. In the definitions of ROS 2, a goal lies next to
its id, in a field of its own. A bridge may also list the fields of the goal after the id, because
the bytes are the same. Results and feedback are defined in both ways, too. The codec returns their
inner part, as rosbridge does.

Servers of the Foxglove SDK send Protocol Buffers or FlatBuffers instead of ROS messages. Their
schemas are definitions like all others. A type of Protocol Buffers, such as ``foxglove.Log``, is
written by the schema that the robot has sent.

Services have their own definitions, which the transport delivers with the first call. The transport
returns the call with the verb `UNENCODED`; the codec then sends the call again in binary form.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, cast

from urc.model.driver import STOPPED
from urc.model.payload import UNKNOWN_END, Envelope, Payload
from urc.problems import UrcError, printable
from urc.protocol.flatbuffer.read import FlatbufferReader
from urc.protocol.flatbuffer.schema import parse_schema as parse_binary_schema
from urc.protocol.protobuf.read import ProtobufReader
from urc.protocol.protobuf.schema import ProtoTypes, parse_schema
from urc.protocol.protobuf.write import ProtobufWriter
from urc.protocol.ros.common_types import common_types
from urc.protocol.ros.definition import BadDefinition, Definitions, Record, layout_of, plain_name
from urc.protocol.ros.idl_text import parse_idl
from urc.protocol.ros.known_types import check_known, known_hash, known_types
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.read_source import BadRosMessage, Read, build_read, read_safely
from urc.protocol.ros.wanted import ALL, Path, Wanted, wanted_of
from urc.protocol.ros.write_source import Unwritable, Writer

__all__ = ["DEFINITION", "UNENCODED", "Received", "TopicCodec"]

DEFINITION: Final = "definition"
"""Verb of a definition; the envelope has a text body and the attributes `topic`, `type`, `encoding`
and `notation`."""
KNOWN: Final = "known"
"""Notation of a definition without text, which has the attribute `hash` instead."""
UNENCODED: Final = "unencoded"
"""Verb of a call that the transport has returned because it is not yet in binary form. The
attributes are those of the call, plus `request` and `response`, each a list of type, encoding,
notation and text."""
MAX_COMPILED: Final = 256
"""Maximum number of compiled types on one connection. Without this limit, a hostile robot could
announce an unlimited number of new types."""
MAX_SCHEMAS: Final = 64
"""Maximum number of schemas of Protocol Buffers on one connection."""
MAX_PREPARED: Final = 100_000
"""Maximum number of fields in all readers for Protocol Buffers and FlatBuffers; each takes about a
kilobyte."""
_SHOWN: Final = 60
_ORDERS: Final = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
"""Byte order and largest alignment for CDR and plain CDR2, keyed by encapsulation identifier."""


class Received(NamedTuple):
    """The result of decoding a received envelope."""

    envelope: Envelope | None = None
    """Envelope with plain data; None for a definition or a dropped message."""
    reply: Envelope | None = None
    """Envelope to send."""
    fault: str = ""
    """Reason why the envelope was dropped, or ""."""


class _Schema(NamedTuple):
    """A message type, as defined by a robot."""

    type: str
    encoding: str
    notation: str
    text: str


class _Source:
    """The readers for one type, one for each byte order, generated when that order first occurs."""

    def __init__(self, layout: Record, wanted: Wanted, *, is_ros1: bool) -> None:
        self._layout = layout
        self._wanted = wanted
        self._is_ros1 = is_ros1
        self._reads: dict[int, Read] = {}

    def read(self, data: bytes) -> dict[str, Any]:
        """Return the wanted parts of a message; raise `BadRosMessage` or `BadDefinition`."""
        kind = 1 if self._is_ros1 else data[1] if len(data) >= 4 and not data[0] else -1
        read = self._reads.get(kind)
        if read is None:
            if kind not in _ORDERS:
                raise BadRosMessage(
                    f"the message begins with {data[:4].hex(' ')}, which is not CDR"
                )
            order, widest = _ORDERS[kind]
            read = build_read(
                self._layout, self._wanted, order=order, is_ros1=self._is_ros1, widest=widest
            )
            self._reads[kind] = read
        return read_safely(read, data)


class TopicCodec:
    """The codec of one connection; its readers are discarded when the connection is opened."""

    def __init__(
        self,
        paths: Mapping[str, Iterable[Path]] | None = None,
        *,
        is_ros1: bool = False,
        has_hashes: bool = False,
    ) -> None:
        """Initialise without definitions.

        Args:
            paths: paths that the driver reads, keyed by topic; messages on other topics are read
                whole.
            is_ros1: whether to write in the ROS 1 format until a definition determines the format.
            has_hashes: whether the connection uses hashes of types instead of definitions.
        """
        self._wanted = {topic: wanted_of(set(each)) for topic, each in (paths or {}).items()}
        self._is_ros1 = is_ros1
        self._has_hashes = has_hashes
        self._sources: dict[str, _AnySource] = {}
        self._services: dict[str, tuple[_AnyWriter | None, _AnySource | None, str]] = {}
        self._compiled: dict[tuple[object, ...], _AnySource | _AnyWriter] = {}
        self._known: dict[str, Definitions] = {}
        """Definitions from the robot, keyed by the type's short name."""
        self._texts: dict[str, str] = {}
        """Text of each definition in `_known`."""
        self._earlier: dict[str, tuple[Definitions, str]] = {}
        """Newest definitions of earlier connections and their texts, oldest first. They outlive a
        connection for the same reason as `_schema_writers`, until the type is defined again."""
        self._writers: dict[tuple[str, bool], Writer | None] = {}
        self._schemas: dict[str, ProtoTypes] = {}
        """Parsed schemas of Protocol Buffers, keyed by their text."""
        self._schema_writers: dict[str, tuple[ProtobufWriter, str]] = {}
        """Writer and schema of each published type of Protocol Buffers. They outlive a connection,
        because a stop is sent first on the next one. The transport sends the schema, too.
        """
        self._nested: set[str] = set()
        """Topics and services whose messages contain the feedback or the result in a field."""
        self._prepared = 0
        """Number of fields in the readers for Protocol Buffers and FlatBuffers."""
        self._refused: dict[str, str] = {}
        """Reason why the definition of a topic is unreadable, keyed by topic."""
        self._stops = 0
        """Number of presses of STOP."""

    def stop_goals(self) -> None:
        """Refuse all goals that are not encoded yet, after a press of STOP."""
        self._stops += 1

    def reset(self) -> None:
        """Discard the definitions of the previous connection."""
        self._sources.clear()
        self._refused.clear()
        self._prepared = 0
        self._services.clear()
        self._compiled.clear()
        for name, found in self._known.items():
            self._earlier.pop(name, None)
            self._earlier[name] = found, self._texts[name]
        while len(self._earlier) > MAX_COMPILED:
            del self._earlier[next(iter(self._earlier))]
        self._known.clear()
        self._texts.clear()
        self._writers.clear()
        self._schemas.clear()
        self._nested.clear()

    # -- received envelopes

    @staticmethod
    def is_unencoded_goal(envelope: Envelope) -> bool:
        """Return whether the transport asks for the binary form of a goal, before sending it."""
        return envelope.verb == UNENCODED and "goal" in envelope.attributes

    def received(self, envelope: Envelope) -> Received:
        """Return the envelope with plain data in place of bytes."""
        try:
            if envelope.verb == DEFINITION:
                return self._definition(envelope)
            if envelope.verb == UNENCODED:
                return self._encode_call(envelope)
            return Received(self._plain(envelope))
        except (BadRosMessage, BadDefinition) as fault:
            name = envelope.attributes.get("topic") or envelope.attributes.get("service")
            return Received(fault=f"{printable(str(name))[:_SHOWN]}: {fault}")

    def _definition(self, envelope: Envelope) -> Received:
        """Store a definition, or the reason why it is unreadable."""
        topic = str(envelope.attributes.get("topic"))
        self._refused.pop(topic, None)
        try:
            self._define(envelope, topic)
        except BadDefinition as fault:
            self._refused[topic] = str(fault)
            raise
        return Received()

    def _define(self, envelope: Envelope, topic: str) -> None:
        said = envelope.attributes
        self._sources.pop(topic, None)
        self._nested.discard(topic)
        schema = _Schema(
            str(said.get("type")),
            str(said.get("encoding")),
            str(said.get("notation")),
            str(envelope.body),
        )
        if schema.notation == KNOWN:
            check_known(schema.type, str(said.get("hash")))
        if schema.encoding == "json":
            return  # the form ``json`` reads bytes
        is_ros = schema.encoding in ("cdr", "ros1")
        if is_ros:
            self._is_ros1 = schema.encoding == "ros1"
        wanted = self._wanted.get(topic, ALL)
        if is_ros and schema.type.endswith(_FEEDBACK) and self._is_nested(schema, "feedback"):
            wanted = {"feedback": wanted}
            self._nested.add(topic)
        self._sources[topic] = self._source(schema, wanted)

    def _is_nested(self, schema: _Schema, name: str) -> bool:
        """Return whether a type of an action has its content in the field `name`."""
        self._layout(schema)
        short = plain_name(schema.type)
        fields = self._known.get(short, {})[short].fields
        return any(
            one.name == name and one.type.endswith(f"_{name.capitalize()}") for one in fields
        )

    def _source(self, schema: _Schema, wanted: Wanted) -> "_AnySource":
        key = (schema, repr(wanted))
        found = self._compiled.get(key)
        if not isinstance(found, _AnySource):
            if schema.encoding == "protobuf":
                found = ProtobufReader(self._types(schema), schema.type, wanted)
            elif schema.encoding == schema.notation == "flatbuffer":
                found = FlatbufferReader(parse_binary_schema(schema.text), schema.type, wanted)
            else:
                found = _Source(self._layout(schema), wanted, is_ros1=schema.encoding == "ros1")
            if not isinstance(found, _Source):
                self._prepared += found.size
                if self._prepared > MAX_PREPARED:
                    raise BadDefinition(f"the robot's types have more than {MAX_PREPARED} fields")
            self._keep(key, found)
        return found

    def _types(self, schema: _Schema) -> ProtoTypes:
        """Return the types in a schema of Protocol Buffers."""
        if schema.notation != "protobuf":
            raise BadDefinition(f"the definition notation {schema.notation!r} is not supported")
        found = self._schemas.get(schema.text)
        if found is None:
            found = parse_schema(schema.text)
            if len(self._schemas) >= MAX_SCHEMAS:
                raise BadDefinition(f"the robot has announced more than {MAX_SCHEMAS} definitions")
            self._schemas[schema.text] = found
            for kind in self._schema_writers.keys() & found.messages.keys():
                del self._schema_writers[kind]
        return found

    def _request_writer(self, schema: _Schema) -> "_AnyWriter":
        """Return the writer for the requests of a service."""
        key = (schema, "writer")
        found = self._compiled.get(key)
        if not isinstance(found, _AnyWriter):
            if schema.encoding == "protobuf":
                found = ProtobufWriter(self._types(schema), schema.type)
            else:
                found = Writer(self._layout(schema), is_ros1=schema.encoding == "ros1")
            self._keep(key, found)
        return found

    def _keep(self, key: tuple[object, ...], made: "_AnySource | _AnyWriter") -> None:
        if len(self._compiled) >= MAX_COMPILED:
            raise BadDefinition(f"the robot has announced more than {MAX_COMPILED} types")
        self._compiled[key] = made

    def _layout(self, schema: _Schema) -> Record:
        if schema.encoding not in ("cdr", "ros1"):
            raise BadDefinition(f"the message encoding {schema.encoding!r} is not supported")
        if schema.notation == KNOWN:
            return layout_of(schema.type, known_types())
        parse = {"ros2msg": parse_msg, "ros1msg": parse_msg, "ros2idl": parse_idl}.get(
            schema.notation
        )
        if parse is None:
            raise BadDefinition(f"the definition notation {schema.notation!r} is not supported")
        found, short = parse(schema.type, schema.text), plain_name(schema.type)
        self._known[short], self._texts[short] = found, schema.text
        self._earlier.pop(short, None)
        self._writers.pop((plain_name(schema.type), schema.encoding == "ros1"), None)
        return layout_of(schema.type, found, is_ros1=schema.encoding == "ros1")

    def _plain(self, envelope: Envelope) -> Envelope:
        said, body = envelope.attributes, envelope.body
        encoding = said.get("encoding")
        if encoding is None or not isinstance(body, bytes):
            return envelope
        is_message = envelope.verb == "message"
        name = str(said.get("topic" if is_message else "service"))
        is_feedback = is_message and name in self._nested
        if encoding != "json":
            plain = envelope._replace(body=self._read(envelope, body))
        elif "result_of" in said:
            plain = envelope._replace(body=_from_json(body))
        else:
            return envelope
        if is_feedback:
            return plain._replace(body=_part(plain.body, "feedback"))
        return _result(plain, is_nested=name in self._nested) if "result_of" in said else plain

    def _read(self, envelope: Envelope, body: bytes) -> dict[str, Any]:
        said = envelope.attributes
        if envelope.verb == "message":
            topic = str(said.get("topic"))
            source = self._sources.get(topic)
            if topic in self._refused:
                raise BadRosMessage(self._refused[topic])
        else:
            source = self._services.get(str(said.get("service")), (None, None, ""))[1]
        if source is None:
            raise BadRosMessage("a message arrived without the definition of its type")
        return source.read(body)

    # -- calls

    def _encode_call(self, envelope: Envelope) -> Received:
        """Compile the types of a service and return the call in binary form."""
        said = dict(envelope.attributes)
        parts = [cast("list[str]", said.pop(part)) for part in ("request", "response")]
        request, response = (_Schema(*part) for part in parts)
        service = str(said.get("service"))
        if "goal" in said and said.pop("stops", None) != [self._stops]:
            attributes = {"id": said.get("id"), "ok": False, "reason": STOPPED}
            return Received(Envelope("response", attributes))
        try:
            body = envelope.body
            if request.encoding == "json":
                self._services[service] = (None, None, "json")
                self._nested.add(service)
            else:
                writer = self._request_writer(request)
                source = None if response.encoding == "json" else self._source(response, ALL)
                self._services[service] = (writer, source, request.encoding)
                if "goal" in said and not self._is_nested(request, "goal"):
                    body = _flat(body)
                if "result_of" in said and self._is_nested(response, "result"):
                    self._nested.add(service)
            return Received(reply=self._call(Envelope("call", said, body)))
        except (BadDefinition, Unwritable) as fault:
            attributes = {"id": said.get("id"), "ok": False, "reason": str(fault)}
            if "result_of" in said:  # the robot has accepted the goal
                attributes[UNKNOWN_END] = True
            return Received(Envelope("response", attributes))

    def _call(self, envelope: Envelope) -> Envelope:
        found = self._services.get(str(envelope.attributes.get("service")))
        if found is None:
            return envelope
        writer, _, encoding = found
        data, stamps = (b"", ()) if writer is None else writer.write(envelope.body)
        if (
            "goal" in envelope.attributes
            and envelope.body
            and len(cast("dict[str, Any]", envelope.body)) == 1
        ):
            data += b"\0"  # the member of an empty goal, which a bridge does not list
        return envelope._replace(
            attributes={
                **envelope.attributes,
                "encoding": encoding,
                "data": data,
                "stamps": list(stamps),
            }
        )

    # -- sent envelopes

    def sent(self, payload: Payload) -> Payload:
        """Return the envelope, with the message's bytes added if the definition is known.

        Raises:
            Unwritable: the message does not fit its type.
        """
        if not isinstance(payload, Envelope):
            return payload
        if payload.verb == "call":
            return self._call(payload)
        if payload.verb == "goal":
            return payload._replace(attributes={**payload.attributes, "stops": [self._stops]})
        if payload.verb != "publish":
            return payload
        kind = str(payload.attributes.get("type") or "")
        if "." in kind and (found := self._schema_writer(kind)) is not None:
            return _with_schema(payload, *found)
        writer = self._writer(plain_name(kind))
        if writer is None:
            return payload
        written = writer.write(payload.body)
        added: dict[str, object] = {
            "encoding": "ros1" if self._is_ros1 else "cdr",
            "data": written.data,
            "stamps": list(written.stamps),
        }
        if (earlier := self._earlier.get(plain_name(kind))) is not None:
            added["definition"] = earlier[1]
        if self._has_hashes:
            added["hash"] = known_hash(str(payload.attributes.get("type")))
        return payload._replace(attributes={**payload.attributes, **added})

    def _schema_writer(self, kind: str) -> tuple[ProtobufWriter, str] | None:
        """Return the writer for a type of Protocol Buffers and its schema, if one contains it."""
        found = self._schema_writers.get(kind)
        if found is None:
            for text, types in self._schemas.items():
                if kind in types.messages:
                    found = self._schema_writers[kind] = ProtobufWriter(types, kind), text
                    break
        return found

    def _writer(self, name: str) -> Writer | None:
        key = (name, self._is_ros1)
        if key not in self._writers:
            is_known = self._has_hashes and not self._is_ros1
            common = known_types() if is_known else common_types(is_ros1=self._is_ros1)
            earlier, _ = self._earlier.get(name, (common, ""))
            definitions = self._known.get(name, earlier)
            try:
                layout = layout_of(name, definitions, is_ros1=self._is_ros1)
                self._writers[key] = Writer(layout, is_ros1=self._is_ros1)
            except UrcError:
                self._writers[key] = None
        return self._writers[key]


_AnySource = _Source | ProtobufReader | FlatbufferReader
_AnyWriter = Writer | ProtobufWriter
_CANCELLED: Final = 5
_OUTCOMES: Final = {
    4: "",
    _CANCELLED: "the action was cancelled",
    6: "the action was aborted",
}
"""Outcome of each status of a goal that has ended (action_msgs/msg/GoalStatus)."""
_NO_STATUS: Final = "the bridge sent a result without a status"
_FEEDBACK: Final = "_FeedbackMessage"
"""End of the name of the type of an action's feedback."""


def _result(said: Envelope, *, is_nested: bool) -> Envelope:
    """Return the reply to a request for a goal's result as the reply to the goal."""
    body = said.body if isinstance(said.body, Mapping) else {}
    status = body.get("status")
    reason = _OUTCOMES.get(status, "the action failed") if isinstance(status, int) else _NO_STATUS
    if status == _CANCELLED:
        reason = str(said.attributes.get("why_cancelled") or reason)
    attributes: dict[str, object] = {
        "id": said.attributes.get("id"),
        "ok": not reason,
        "status": status,
    }
    if reason:
        attributes["reason"] = reason
    if status not in _OUTCOMES:
        attributes[UNKNOWN_END] = True
    flat = {name: value for name, value in body.items() if name != "status"}
    return Envelope("response", attributes, body.get("result") if is_nested else flat)


def _with_schema(payload: Envelope, writer: ProtobufWriter, schema: str) -> Envelope:
    """Return a message with its bytes, and with the schema that its reader needs."""
    written = writer.write(payload.body)
    added = {
        "encoding": "protobuf",
        "data": written.data,
        "stamps": list(written.stamps),
        "schema": schema,
    }
    return payload._replace(attributes={**payload.attributes, **added})


def _flat(body: object) -> object:
    """Return a request to send a goal with the goal's fields next to its id."""
    if not isinstance(body, Mapping) or not isinstance(body.get("goal"), Mapping):
        return body
    return {"goal_id": body.get("goal_id"), **body["goal"]}


def _part(body: object, name: str) -> Any:
    return body.get(name) if isinstance(body, Mapping) else None


def _from_json(data: bytes) -> object:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as fault:
        raise BadRosMessage(f"the message is not JSON ({fault})") from fault
