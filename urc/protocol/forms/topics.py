"""A driver's topics and subscriptions on a message transport.

Pure. A topic may have MQTT wildcards (version 5.0, section 4.7): ``+`` for one level, and ``#`` at
the end for all following levels. On Zenoh, a topic is a key expression
(`urc.key_expressions`).
"""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, cast

from urc.expressions import ExpressionError, Template
from urc.key_expressions import key_matches
from urc.model.driver import Driver, Reply, TransportSpec
from urc.model.payload import Envelope, Payload, ReadSpec, each_of
from urc.model.sequence import ExpectStep, SendStep, all_steps
from urc.model.values import WHOLE_TYPES, Value
from urc.problems import UrcError
from urc.protocol.forms.json_text import filled
from urc.protocol.readings.capture_times import capture_paths
from urc.protocol.ros.wanted import ALL, EACH, PACKED, Path, paths_of, wanted_of
from urc.protocol.values.payload import CodecContext, Frame, NotWritable, PayloadReader
from urc.protocol.values.time_and_nonce import FIXED, TimeAndNonce
from urc.ros_names import resolved_name

__all__ = [
    "PublishedTopic",
    "ReadTopic",
    "TopicReader",
    "actions_of",
    "context_of",
    "frame_of",
    "listened",
    "matches",
    "namespace_of",
    "packed_topics",
    "paths_by_topic",
    "published",
    "read_topics",
    "topic_of",
]

FEEDBACK = "/feedback"
"""Suffix that turns an action's name into the name of its feedback topic."""


class TopicReader:
    """A reader for the messages on one topic; another form's reader decodes each message.

    For a topic with wildcards, the field ``_topic`` contains the actual topic.
    """

    def __init__(self, reader: PayloadReader, spec: ReadSpec, context: CodecContext) -> None:
        self._reader = reader
        self._topic = topic_of(spec, context.settings, context.namespace)
        self._fits = key_matches(self._topic) if context.has_keys else matches(self._topic)
        self._wild = _KEY_WILD if context.has_keys else _WILD
        self._is_plain = not self._wild.search(self._topic)
        self._is_off = not self._topic
        """Whether the topic is empty, so that no message matches."""

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields; None if the topic or the message does not match."""
        topic = frame.topic
        if self._is_off:
            return None
        if topic != self._topic if self._is_plain else topic is None or not self._fits(topic):
            return None
        found = self._reader.read(frame)
        return found if found is None or self._is_plain else {**found, "_topic": topic}

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a message with `fields`; raise `NotWritable` if impossible."""
        topic = str(fields.get("_topic") or self._wild.sub("x", self._topic))
        if not self._fits(topic):
            raise NotWritable(f"{topic!r} does not match the topic {self._topic!r}")
        body = self._reader.write({name: raw for name, raw in fields.items() if name != "_topic"})
        return Envelope("message", {"topic": topic}, body)


_WILD = re.compile(r"(?<![^/])[+#](?![^/])")
_KEY_WILD = re.compile(r"[$]?[*]+")


def matches(topic: str) -> Callable[[str], bool]:
    """Return a function that checks whether a name matches `topic`, including wildcards."""
    if not _WILD.search(topic):
        return lambda name: name == topic
    levels = topic.split("/")
    is_open = levels[-1] == "#"
    fixed = levels[:-1] if is_open else levels

    def fits(name: str) -> bool:
        found = name.split("/")
        if len(found) < len(fixed) or (len(found) > len(fixed) and not is_open):
            return False
        return all(want in ("+", has) for want, has in zip(fixed, found, strict=False))

    return fits


def topic_of(spec: ReadSpec, settings: Mapping[str, object], namespace: str | None = None) -> str:
    """Return the topic in a declaration; raise `UrcError` if the template fails.

    Args:
        spec: the declaration.
        settings: values of the settings.
        namespace: namespace for relative names; see `namespace_of`.
    """
    try:
        topic = "" if spec.topic is None else str(spec.topic.evaluate({"settings": settings}))
    except ExpressionError as error:
        raise UrcError(f"a topic: {error}") from None
    return resolved_name(topic, namespace)


def namespace_of(spec: TransportSpec, settings: Mapping[str, object]) -> str | None:
    """Return the namespace of a ROS connection; None if the document declares none.

    Raises:
        UrcError: the template fails.
    """
    if spec.type != "ros" or "namespace" not in spec.options:
        return None
    try:
        return str(filled(spec.options["namespace"], {"settings": settings}))
    except ExpressionError as error:
        raise UrcError(f"{spec.name}: namespace: {error}") from None


def context_of(
    spec: TransportSpec,
    settings: Mapping[str, object],
    fresh: TimeAndNonce = FIXED,
    *,
    is_compiled: bool = False,
) -> CodecContext:
    """Return the context for the readers and writers of a transport."""
    namespace = namespace_of(spec, settings)
    return CodecContext(spec.encoding, settings, fresh, is_compiled, spec.has_keys, namespace)


def frame_of(payload: Payload, encoding: str) -> Frame:
    """Return received data as a frame; if an envelope contains bytes, they become the payload."""
    if not isinstance(payload, Envelope):
        return Frame(payload, encoding)
    attributes, body = payload.attributes, payload.body
    topic = attributes.get("topic")
    if payload.verb == "feedback" and topic is None:
        topic = f"{attributes.get('action')}{FEEDBACK}"
    frame = Frame(body if isinstance(body, bytes) else payload, encoding)
    frame.topic = None if topic is None else str(topic)
    frame.attributes = attributes
    return frame


def listened(
    driver: Driver, transport: str, settings: Mapping[str, object]
) -> dict[str, Mapping[str, Value]]:
    """Return a driver's subscription options for a transport, keyed by topic.

    If several declarations have the same topic, the first options take precedence, and later
    options add missing keys. An empty topic, such as from an empty setting, is left out. For the
    topic of a transform tree, the engine applies ``throttle`` itself. Several programs publish on
    this topic, and a throttle in the bridge would drop the transforms of some of them.
    """
    topics: dict[str, dict[str, Value]] = {}
    trees: set[str] = set()
    namespace = namespace_of(driver.transports[transport], settings)
    for read in _reads(driver, transport):
        if read.topic is not None and (topic := topic_of(read, settings, namespace)):
            mine = topics.setdefault(topic, {})
            for name, value in read.listen.items():
                mine.setdefault(name, value)
            signals = (driver.signals.get(field) for field in read.fields)
            if any(one is not None and one.type == "transform_tree" for one in signals):
                trees.add(topic)
    for topic in trees:
        for name in ("throttle", "queue_length"):
            topics[topic].pop(name, None)
    return dict(topics)


class ReadTopic(NamedTuple):
    """A topic that a driver reads."""

    fields: frozenset[str]
    """Signals and other fields that the topic's messages set."""
    is_only_listened: bool
    """Whether messages alone read the topic: no reply, step or acknowledgement needs it."""


def read_topics(
    driver: Driver, transport: str, settings: Mapping[str, object]
) -> dict[str, ReadTopic]:
    """Return the topics that a driver reads on a transport, keyed by topic."""
    listening = [one for one in driver.messages.values() if one.transport == transport]
    simple = [one.read for one in listening if one.acknowledge is None]
    found: dict[str, ReadTopic] = {}
    namespace = namespace_of(driver.transports[transport], settings)
    for read in _reads(driver, transport):
        if read.topic is not None and (topic := topic_of(read, settings, namespace)):
            fields, is_only = found.get(topic, ReadTopic(frozenset(), is_only_listened=True))
            is_simple = any(read is one for one in simple)
            found[topic] = ReadTopic(fields | set(read.fields), is_only and is_simple)
    return found


class PublishedTopic(NamedTuple):
    """A topic that a command publishes."""

    command: str
    topic: str
    type: str
    """Declared type; "" if undeclared."""


def published(
    driver: Driver, transport: str, settings: Mapping[str, object]
) -> Iterator[PublishedTopic]:
    """Yield the topics that a driver's commands publish on a transport.

    A topic that depends on the arguments of a command is left out.
    """
    namespace = namespace_of(driver.transports[transport], settings)
    for command in driver.commands.values():
        for spec in each_of(command.send) if command.transport == transport else ():
            if spec.form != "envelope" or spec.options.get("verb") != "publish":
                continue
            attributes = cast("Mapping[str, object]", spec.options["attributes"])
            found = [_fixed(attributes.get(name), settings) for name in ("topic", "type")]
            if found[0] and found[1] is not None:
                yield PublishedTopic(command.name, resolved_name(found[0], namespace), found[1])


def actions_of(driver: Driver, transport: str, settings: Mapping[str, object]) -> tuple[str, ...]:
    """Return the ROS actions to which a driver's commands send goals or cancellations.

    An action whose name depends on the arguments of a command is left out.
    """
    found: dict[str, None] = {}
    namespace = namespace_of(driver.transports[transport], settings)
    for command in driver.commands.values():
        sends = [(command.transport, one) for one in each_of(command.send)]
        steps = (step for step in all_steps(command.steps) if isinstance(step, SendStep))
        sends += [(step.transport, one) for step in steps for one in each_of(step.send)]
        for line, spec in sends:
            if line == transport and spec.options.get("verb") in ("goal", "cancel"):
                attributes = cast("Mapping[str, object]", spec.options["attributes"])
                if action := _fixed(attributes.get("action"), settings):
                    found[resolved_name(action, namespace)] = None
    return tuple(found)


def _fixed(value: object, settings: Mapping[str, object]) -> str | None:
    """Return an attribute as text; None if the attribute depends on arguments."""
    if isinstance(value, Template):
        if not value.names <= {"settings"}:
            return None
        try:
            value = value.evaluate({"settings": settings})
        except ExpressionError:
            return None
    return str(value or "")


def paths_by_topic(
    driver: Driver, transport: str, settings: Mapping[str, object]
) -> dict[str, list[Path]]:
    """Return the paths that a driver reads in each topic's messages; see `paths_of`."""
    kinds = {
        kind: {name for name, one in driver.signals.items() if one.type == kind}
        for kind in WHOLE_TYPES
    }
    found: dict[str, list[Path]] = {}
    namespace = namespace_of(driver.transports[transport], settings)
    for read in _reads(driver, transport):
        if read.topic is not None:
            paths = list(paths_of(read, kinds["occupancy_grid"], kinds["transform_tree"]))
            for places in capture_paths(read, driver.signals).values():
                paths += [tuple(s if isinstance(s, str) else EACH for s in one) for one in places]
            found.setdefault(topic_of(read, settings, namespace), []).extend(paths)
    return found


def packed_topics(driver: Driver, transport: str, settings: Mapping[str, object]) -> frozenset[str]:
    """Return the topics of occupancy grids whose cells no declaration reads as numbers."""
    grids = any(one.type == "occupancy_grid" for one in driver.signals.values())
    found = paths_by_topic(driver, transport, settings) if grids else {}
    wanted = {topic: wanted_of(set(paths)) for topic, paths in found.items()}
    return frozenset(
        topic
        for topic, parts in wanted.items()
        if isinstance(parts, dict) and parts.get("data") == {PACKED: ALL}
    )


def _reads(driver: Driver, transport: str) -> Iterator[ReadSpec]:
    for message in driver.messages.values():
        if message.transport == transport:
            yield message.read
    yield from (fault.read for fault in driver.transports[transport].faults)
    replies = [(one.transport, one.reply) for one in driver.commands.values()]
    replies += [(one.transport, one.reply) for one in driver.polls]
    for name, reply in replies:
        if name == transport and reply is not None:
            yield from _of_reply(reply)
    scripts = [spec.on_connect + spec.on_close for spec in driver.transports.values()]
    scripts += [command.steps for command in driver.commands.values()]
    for script in scripts:
        for step in all_steps(script):
            if isinstance(step, ExpectStep) and step.transport == transport:
                yield step.read


def _of_reply(reply: Reply) -> Iterator[ReadSpec]:
    yield reply.read
    yield from (stage.read for stage in reply.stages)
    asides = (reply.asides, *(stage.asides for stage in reply.stages))
    yield from (read for one in asides for read in (one.resend, one.extend) if read is not None)
    yield from (fault.read for fault in reply.faults)
