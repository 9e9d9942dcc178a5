"""Compile a driver's declared requests, once for each engine. Pure."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from urc.capture_clock import CaptureClock
from urc.expressions import COUNTERS, NONCE, NOW
from urc.model.driver import Argument, Command, Driver, Message, Poll, Reply, TransportSpec
from urc.model.exchange import RESENDS, ProvisionalReplies, Stage
from urc.model.payload import NUMBERED, Payload, ReadSpec, WriteSpec
from urc.model.sequence import ExpectStep, SendStep
from urc.model.text import JsonPath
from urc.model.values import NOTHING
from urc.protocol.forms.http_head import LOCATION
from urc.protocol.forms.json_text import filled
from urc.protocol.forms.table import build_reader
from urc.protocol.forms.topics import context_of, paths_by_topic, topic_of
from urc.protocol.framing.table import build_framing
from urc.protocol.readings.capture_times import (
    StampedReader,
    arriving,
    capture_paths,
    dating,
    with_captures,
)
from urc.protocol.readings.compiled import build_fast_read
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.bounds import queue_limit_s
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.encode import BadArgument, Encode, build_encode
from urc.protocol.requests.exchange import CompiledRequest
from urc.protocol.requests.message_effects import (
    Acknowledgements,
    Collector,
    answering,
    collecting,
    noting,
)
from urc.protocol.requests.rate import RANKS, GcraLimiter
from urc.protocol.requests.reply_match import Aside, CompiledReply, Matcher
from urc.protocol.values.payload import CodecContext
from urc.protocol.values.time_and_nonce import FIXED, TimeAndNonce

if TYPE_CHECKING:
    from urc.protocol.ros.topic_codec import TopicCodec

__all__ = ["RequestCompiler"]


class RequestCompiler:
    """A compiler for the requests of one driver.

    Raises:
        BadArgument: a constant frame contains its own delimiter or cannot be encoded. Every public
            method may also raise `BadArgument`.
    """

    def __init__(
        self,
        driver: Driver,
        readings: Readings,
        known: SignalState,
        fresh: TimeAndNonce = FIXED,
        *,
        is_compiled: bool = False,
    ) -> None:
        self._driver = driver
        self._fresh = fresh
        self._is_compiled = is_compiled
        self._readings = readings
        self._known = known
        self.lines: dict[str, Conversation] = {}
        for name, spec in driver.transports.items():
            messages = [one for one in driver.messages.values() if one.transport == name]
            context = context_of(spec, self._readings.settings, fresh, is_compiled=is_compiled)
            matchers = [self._message(one.read, context) for one in messages]
            captures = self._captures(spec, messages)
            if any(captures) or any(
                self._is_image_of_camera(spec, one.read)
                or one.acknowledge
                or one.log
                or one.read.collects
                or self._is_video(one.read)
                for one in messages
            ):
                self._react(spec, messages, matchers, captures, context)
            else:
                self.lines[name] = Conversation(spec, matchers)
            self.lines[name].codec = self._codec(spec)

    def _codec(self, spec: TransportSpec) -> "TopicCodec | None":
        """Return the codec for a connection that may carry binary ROS messages."""
        if spec.type != "ros" or spec.options.get("via", "rosbridge") == "rosbridge":
            return None
        from urc.protocol.ros.topic_codec import TopicCodec  # takes 4 ms, so only for these

        settings = self._readings.settings
        has_hashes = filled(spec.options.get("via"), {"settings": settings}) == "zenoh"
        paths = paths_by_topic(self._driver, spec.name, settings)
        return TopicCodec(paths, is_ros1=spec.options.get("version") == 1, has_hashes=has_hashes)

    def _is_video(self, read: ReadSpec) -> bool:
        """Return whether a message contains a video, in another form than a camera's."""
        signals = self._driver.signals
        return read.form == "json" and any(
            signals[name].type == "video" for name in read.fields if name in signals
        )

    def _is_image_of_camera(self, spec: TransportSpec, read: ReadSpec) -> bool:
        signals = self._driver.signals
        return spec.is_camera and any(
            signals[name].type == "image" for name in read.fields if name in signals
        )

    def _captures(
        self, spec: TransportSpec, messages: list[Message]
    ) -> list[dict[str, tuple[JsonPath, ...]]]:
        """Return the places of times of capture in each message; none for simulated times.

        A simulation may run slower than the clock of this computer.
        """
        settings = self._readings.settings
        if filled(spec.options.get("use_sim_time"), {"settings": settings}) is True:
            return [{} for _ in messages]
        return [capture_paths(one.read, self._driver.signals) for one in messages]

    def _react(
        self,
        spec: TransportSpec,
        messages: list[Message],
        matchers: list[Matcher],
        captures: list[dict[str, tuple[JsonPath, ...]]],
        context: CodecContext,
    ) -> None:
        """Add the effects that messages declare, such as acknowledgements, to their matchers."""
        replies, kept = Acknowledgements(), list[Collector]()
        framing, name = build_framing(spec.framing), spec.name
        clocks: dict[str, CaptureClock] = {}
        for place, (one, matcher) in enumerate(zip(messages, matchers, strict=True)):
            decode, reader = matcher.decode, matcher.reader
            if captures[place] or self._is_video(one.read):
                stamped = with_captures(one.read, captures[place])
                reader = StampedReader(build_reader(stamped, context))
                decode = dating(captures[place], clocks, replies.note_of(name), decode)
            if self._is_image_of_camera(spec, one.read):
                decode = arriving(decode)
            if one.read.collects:
                collectors = {key: Collector(what) for key, what in one.read.collects.items()}
                kept += collectors.values()
                decode = collecting(collectors, self._readings.settings, decode)
            if one.acknowledge is not None:
                encode = build_encode(one.acknowledge, framing, context)
                counts = COUNTERS in one.acknowledge.names
                counters = (lambda: self.lines[name].counters) if counts else None
                decode = answering(encode, partial(self._view, name), counters, replies, decode)
            if one.log is not None:
                decode = noting(one.log, name, partial(self._view, name), replies, decode)
            if decode is not matcher.decode:
                matchers[place] = Matcher(reader, decode)
        line = self.lines[name] = Conversation(spec, matchers)
        line.receiver.replies, line.receiver.collectors = replies, kept

    def _view(self, line: str, now: float, found: Mapping[str, object]) -> Mapping[str, object]:
        """Return the namespace for a message: fields, signals and login fields."""
        return self._known.view(now, {**self.lines[line].learnt, **found})

    def command(self, command: Command) -> CompiledRequest:
        """Return the compiled request for a command."""
        ask = self._compile(
            command.name, command.transport, command.send, command.reply, command.arguments
        )
        return ask._replace(
            rank=RANKS[command.priority],
            is_latest_only=command.is_latest_only,
            bucket=GcraLimiter(command.rate_per_s) if command.rate_per_s else None,
            retries=command.retries or ask.retries,
            is_repeated=command.is_idempotent and command.retries > 0,
            retry=command.retry,
            is_motion=command.hold is not None,
        )

    def poll(self, poll: Poll, label: str) -> CompiledRequest:
        """Return the compiled request for a poll."""
        ask = self._compile(label, poll.transport, poll.send, poll.reply)
        return ask._replace(rank=RANKS[poll.priority], is_miss_harmless=poll.offline is not None)

    def plain(self, label: str, transport: str, send: WriteSpec) -> CompiledRequest:
        """Return a compiled request that expects no reply."""
        return self._compile(label, transport, send, None)

    def compile_step(self, label: str, step: SendStep) -> CompiledRequest:
        """Return the compiled request for a step.

        Requests of steps all have normal rank, so they keep the order of the steps.
        """
        return self.plain(label, step.transport, step.send)._replace(rank=RANKS["normal"])

    def expected(self, step: ExpectStep) -> CompiledReply:
        """Return the compiled reply that a step expects."""
        stage = Stage(step.read, step.errors, step.faults, step.timeout_s)
        answer = self._answer(step.transport, stage)
        return answer._replace(framing=step.framing and build_framing(step.framing))

    def reply_s(self, transport: str) -> float:
        """Return the default reply timeout of a transport, in seconds."""
        return self.lines[transport].spec.timeouts.reply_s

    def _compile(
        self,
        label: str,
        transport: str,
        send: WriteSpec,
        reply: Reply | None,
        arguments: Mapping[str, Argument] = NOTHING,
    ) -> CompiledRequest:
        line = self.lines[transport]
        context = context_of(
            line.spec, self._readings.settings, self._fresh, is_compiled=self._is_compiled
        )
        encode = build_encode(send, line.framing, context, arguments)
        if line.codec is not None:
            encode = _converting(encode, line.codec)
        has_counters = COUNTERS in send.names
        is_fresh = bool((send.names & {NOW, NONCE}) - arguments.keys())
        learnt = (send.names & self._driver.learnt(transport)) - arguments.keys()
        is_numbered = send.options.get("verb") in NUMBERED
        is_local = send.names <= {*arguments, COUNTERS}
        if reply is None:
            return CompiledRequest(
                label,
                encode,
                has_counters=has_counters,
                is_numbered=is_numbered,
                is_local=is_local,
                learnt=learnt,
                is_fresh=is_fresh,
                queue_s=queue_limit_s(line.spec, None),
            )
        reply = reply.with_errors(line.spec.errors, line.spec.faults)
        stages = (
            Stage(reply.read, reply.errors, reply.faults, reply.timeout_s, reply.asides),
            *reply.stages,
        )
        answers = tuple(self._answer(transport, one) for one in stages)
        return CompiledRequest(
            label,
            encode,
            answers,
            match=reply.match,
            retries=RESENDS if reply.is_asked_again else 0,
            framing=None if reply.framing is None else build_framing(reply.framing),
            has_counters=has_counters,
            is_numbered=is_numbered,
            is_local=is_local and reply.match is None,
            learnt=learnt,
            is_fresh=is_fresh,
            queue_s=queue_limit_s(line.spec, answers[0].timeout_s),
            plain=self._message(reply.read, context)
            if _is_plain(reply) and not is_numbered
            else None,
        )

    def _answer(self, transport: str, stage: Stage) -> CompiledReply:
        spec = self.lines[transport].spec
        context = context_of(spec, self._readings.settings)
        asides: tuple[tuple[Aside, ReadSpec | None], ...]
        asides = (("resend", stage.asides.resend), ("extend", stage.asides.extend))
        return CompiledReply(
            self._matcher(stage.read, context),
            spec.timeouts.reply_s if stage.timeout_s is None else stage.timeout_s,
            stage.errors,
            tuple((self._matcher(one.read, context), one.text) for one in stage.faults),
            stage.read.lines,
            asides=tuple(
                (kind, self._matcher(read, context)) for kind, read in asides if read is not None
            ),
            extend_s=stage.asides.extend_s,
            is_silence=stage.read.form == "silence",
            takes_redirects=LOCATION in stage.read.head.values(),
        )

    def _message(self, read: ReadSpec, context: CodecContext) -> Matcher:
        matcher = self._matcher(read, context)
        if not context.is_compiled or read.topic is not None:
            return matcher  # compiled functions don't check topics
        compiled = build_fast_read(
            read, matcher.reader, self._readings, matcher.take, context.encoding
        )
        return Matcher(matcher.reader, matcher.decode, compiled)

    def _matcher(self, read: ReadSpec, context: CodecContext) -> Matcher:
        topic = "" if read.topic is None else topic_of(read, context.settings, context.namespace)
        throttle = read.listen.get("throttle")
        throttle_s = throttle if isinstance(throttle, float) else None
        decode = self._readings.decoder(read.fields, topic, throttle_s)
        return Matcher(build_reader(read, context), decode)


def _converting(encode: Encode, codec: "TopicCodec") -> Encode:
    """Return a function that adds the bytes of a ROS message to an envelope."""
    from urc.protocol.ros.write_source import Unwritable  # loaded with the codec

    def converted(namespace: Mapping[str, object]) -> Payload:
        try:
            return codec.sent(encode(namespace))
        except Unwritable as problem:
            raise BadArgument(str(problem)) from None

    return converted


def _is_plain(reply: Reply) -> bool:
    """Return whether a reply is a single frame that contains only samples."""
    read = reply.read
    has_own = any(name.startswith("_") for name in read.fields)
    has_more = reply.errors or reply.faults or reply.stages or reply.match or reply.framing
    return not (has_more or has_own or read.lines or reply.asides != ProvisionalReplies())
