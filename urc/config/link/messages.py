"""Checks whether messages fit the type of their transport."""

from collections.abc import Iterator, Mapping

from urc.config.form_table import WRITE_FORMS
from urc.config.link.keys import check_key, check_sent_keys
from urc.config.messaging import BYTE_LINES, CARRIERS, MESSAGING, VIDEO_TYPES
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Driver, TransportSpec
from urc.model.payload import ReadSpec
from urc.model.values import Signal

__all__ = ["check_messages", "check_via"]

_VERBS = {verb for one in MESSAGING.values() for verb in one.verbs}
_NONE = Signal("")
_ANSWERED = ("call", "goal", "request", "get")
_SENT = ("image", "video")
_VIDEOS = ("h264", "hevc")


def check_messages(part: Node, driver: Driver, problems: Problems) -> None:
    """Report messages that a transport cannot carry, and received messages without a topic."""
    for name, inner in part.named("messages").items():
        spec = driver.transports.get(driver.messages[name].transport)
        _check_read(inner, spec, problems, wants_topic=True)
        _check_video(inner, spec, driver, driver.messages[name].read, problems)
        _check_answer(inner.get("acknowledge"), spec, problems)
    for place, inner in _requests(part):
        spec = driver.transports.get(_target(place, driver))
        verb = _check_send(inner.get("send"), spec, problems)
        reply = inner.get("reply")
        if reply is not None:
            _check_read(reply, spec, problems, wants_topic=verb not in _ANSWERED)
    for name, inner in part.named("transports").items():
        keepalive, spec = inner.get("keepalive"), driver.transports.get(name)
        if spec is not None and spec.has_keys:
            check_key(inner.get("liveliness"), problems)
        if keepalive is not None:
            _check_send(keepalive.get("send"), spec, problems)
        for key in ("on_connect", "on_close"):
            is_asked = False  # whether the previous step sends a request with a reply
            for step in inner.listed(key):
                _check_step(step, spec, problems, wants_topic=not is_asked)
                send = step.get("send")
                if send is not None:
                    data = send.data
                    is_asked = isinstance(data, dict) and not data.keys().isdisjoint(_ANSWERED)


def _check_video(
    part: Node,
    spec: TransportSpec | None,
    driver: Driver,
    read: ReadSpec,
    problems: Problems,
) -> None:
    """Report a camera's message that sets no video, and a video from another transport."""
    if spec is None:
        return
    signals = [driver.signals[name] for name in read.fields if name in driver.signals]
    is_video = [one.type == "video" for one in signals]
    kind = _sent_type(spec)
    is_sent = [kind in (one.type, "") and one.type in _SENT for one in signals]
    if spec.is_camera and not ("raw" in part.data and is_sent and all(is_sent)):
        known = kind or "video"
        problems.error(
            part,
            "wrong-form",
            f"{spec.type} delivers only {'images' if known == 'image' else 'a video'}",
            key=True,
            hint=f"write raw: NAME, where the signal NAME has type: {known}",
        )
    elif spec.is_camera and not all(one.has_capture_time for one in signals):
        problems.error(
            part,
            "misplaced-key",
            f"'capture_time' has no effect for a video of a {spec.type}",
            key=True,
            hint="remove it from the signal: only messages have stamps that can be ignored",
        )
    elif spec.type == "ros" and any(is_video):
        _check_video_message(part, read, driver, problems)
    elif not spec.is_camera and any(is_video) and spec.type in (*MESSAGING, *BYTE_LINES):
        problems.error(
            part,
            "wrong-form",
            f"{spec.type} delivers no video",
            key=True,
            hint="declare a transport of type: camera, and the signal of this message as an image",
        )


def _sent_type(spec: TransportSpec) -> str:
    """Return the type of a camera's signal: ``video`` or ``image``; "" if a setting decides."""
    url = spec.options.get("url")
    source = url.source if isinstance(url, Template) else str(url)
    made, wanted = spec.options.get("transcode"), spec.options.get("format", "mjpeg")
    if made is not None:
        return "" if isinstance(made, Template) else "image" if made == "jpeg" else "video"
    if not source.lower().startswith("v4l2://"):
        return "" if source.startswith("{{") else "video"
    if isinstance(wanted, Template):
        return ""
    return "video" if wanted in _VIDEOS else "image"


def _check_video_message(part: Node, read: ReadSpec, driver: Driver, problems: Problems) -> None:
    """Report a video that is not the whole message of a known type, or whose parts are dropped."""
    paths = read.options.get("paths")
    found = paths if read.form == "json" and isinstance(paths, Mapping) else {}
    videos = [name for name in read.fields if driver.signals.get(name, _NONE).type == "video"]
    if read.listen.get("type") not in VIDEO_TYPES or any(found.get(one) != () for one in videos):
        problems.error(
            part,
            "wrong-form",
            "a video over ros is the whole message of a known type",
            key=True,
            hint="write type: foxglove.CompressedVideo or ffmpeg_image_transport_msgs/FFMPEGPacket,"
            ' and json: { NAME: "@" }',
        )
    listen = part.get("subscribe")
    for key in ("throttle", "queue_length"):
        if listen is not None and key in listen.data:
            problems.error(
                listen,
                "misplaced-key",
                f"{key!r} would drop parts of the video",
                at=key,
                key=True,
                hint="remove it: URC drops whole groups of pictures if it falls behind",
            )


def _check_answer(part: Node | None, spec: TransportSpec | None, problems: Problems) -> None:
    """Report an acknowledgement or reply in a form that expects another reply."""
    verb = _check_send(part, spec, problems)
    if part is not None and verb in _ANSWERED:
        problems.error(
            part,
            "wrong-form",
            f"a reply in the form {verb!r} would itself need a reply",
            at=verb,
            key=True,
            hint="write 'publish', or write text or bytes on a byte transport",
        )


def _requests(part: Node) -> Iterator[tuple[tuple[str, int | str], Node]]:
    for name, inner in part.named("commands").items():
        yield ("commands", name), inner
    for place, inner in enumerate(part.listed("polls")):
        yield ("polls", place), inner


def _target(place: tuple[str, int | str], driver: Driver) -> str:
    kind, key = place
    if kind == "polls":
        return driver.polls[int(key)].transport
    return driver.commands[str(key)].transport


def _check_step(
    part: Node, spec: TransportSpec | None, problems: Problems, *, wants_topic: bool
) -> None:
    _check_send(part.get("send"), spec, problems)
    expect = part.get("expect")
    if expect is not None and isinstance(expect.data, dict):
        _check_read(expect, spec, problems, wants_topic=wants_topic)


def _check_send(part: Node | None, spec: TransportSpec | None, problems: Problems) -> str:
    """Report a form that the transport cannot carry; return the form's key."""
    if part is None or spec is None:
        return ""
    data = part.data
    form = next((key for key in data if key in WRITE_FORMS), "") if isinstance(data, dict) else ""
    kind = MESSAGING.get(spec.type)
    if spec.is_camera:
        problems.error(
            part,
            "wrong-form",
            f"{spec.type} accepts no data, so nothing can be sent to it",
            key=True,
            hint="name another transport in 'to', such as http for the camera's settings",
        )
    elif kind is not None and form not in kind.verbs:
        verbs = ", ".join(kind.verbs)
        problems.error(
            part,
            "wrong-form",
            f"{spec.type} carries messages, but {form or 'text'} has no address",
            hint=f"on {spec.type}, use one of: {verbs}; put the text inside it, as text: …",
        )
    elif kind is None and form in _VERBS and spec.type not in MESSAGING:
        problems.error(
            part,
            "wrong-form",
            f"{spec.type} carries bytes and does not support {form!r}",
            at=form,
            key=True,
            hint="write text, or one of the forms hex, bytes, struct and json",
        )
    elif form and spec.has_keys:
        check_sent_keys(part.must(form), problems)
    elif form and spec.type == "ros":
        _check_ros(part.must(form), problems)
        if spec.options.get("via") == "zenoh":
            _check_ros_zenoh(part.must(form), problems)
    return form


def _check_ros(part: Node, problems: Problems) -> None:
    """Report a message without a type, or in a form that a ROS bridge cannot carry."""
    for key in ("text", "hex", "bytes", "struct"):
        if key in part.data:
            problems.error(
                part,
                "wrong-form",
                f"ros carries JSON and does not support {key!r}",
                at=key,
                key=True,
                hint="write the message's fields: json: { data: … }",
            )
    if part.name == "publish" and "type" not in part.data:
        problems.error(
            part,
            "missing-key",
            "'type' is missing, and the topic might not be advertised yet",
            key=True,
            hint="'rostopic info' shows the type, such as type: geometry_msgs/Twist",
        )


def _check_ros_zenoh(part: Node, problems: Problems) -> None:
    """Report what ROS 2 over Zenoh cannot do: anything but topics, and topics that are latched."""
    is_topic = part.name == "publish"
    if is_topic and not part.data.get("retain"):
        return
    problems.error(
        part,
        "wrong-form",
        "with via: zenoh, topics cannot be latched"
        if is_topic
        else f"with via: zenoh, ros carries topics and does not support {part.name!r}",
        at="retain" if is_topic else "",
        key=True,
        hint="use via: foxglove or via: rosbridge, which need a bridge on the robot",
    )


def _check_read(
    part: Node, spec: TransportSpec | None, problems: Problems, *, wants_topic: bool
) -> None:
    if spec is None:
        return
    subscribe, kind = part.get("subscribe"), MESSAGING.get(spec.type)
    for inner in _answers(part):
        _check_head(inner, spec, problems)
    if kind is None:
        if subscribe is not None:
            problems.error(
                part,
                "misplaced-key",
                f"{spec.type} has no topics to subscribe to",
                at="subscribe",
                key=True,
                hint="remove 'subscribe': the form already matches all data on this transport",
            )
        return
    if subscribe is None:
        if wants_topic and "stages" not in part.data:
            problems.error(
                part,
                "missing-key",
                f"'subscribe' is missing: a message on {spec.type} needs a topic",
                key=True,
                hint="subscribe: { topic: NAME }",
            )
        return
    if spec.has_keys:
        check_key(subscribe.get("topic"), problems, is_expression=True)
    for name, inner in subscribe.entries().items():
        if name != "topic" and name not in kind.listen:
            known = ", ".join(("topic", *kind.listen))
            problems.error(
                inner,
                "misplaced-key",
                f"{name!r} has no effect on {spec.type}",
                key=True,
                hint=f"'subscribe' takes: {known}",
            )


def _answers(part: Node) -> list[Node]:
    """Return the nodes of a received frame, its stages, and its error replies that are mappings."""
    stages = part.listed("stages") if "stages" in part.data else []
    given = [one for one in (part, *stages) if "errors" in one.data]
    refusals = [inner for one in given for inner in one.listed("errors")]
    return [part, *stages, *(inner for inner in refusals if isinstance(inner.data, dict))]


def _check_head(part: Node, spec: TransportSpec, problems: Problems) -> None:
    """Report `head` on a transport whose replies have no headers."""
    if "head" in part.data and spec.type != "http" and spec.type in (*MESSAGING, *BYTE_LINES):
        problems.error(
            part,
            "misplaced-key",
            f"replies over {spec.type} have no headers and no status",
            at="head",
            key=True,
            hint="remove 'head', which is only for replies over http",
        )


def check_via(
    parts: Mapping[str, Node], transports: Mapping[str, TransportSpec], problems: Problems
) -> set[str]:
    """Report each `tunnel` that cannot carry its transport; return the names of all tunnels."""
    carriers: set[str] = set()
    for name, spec in transports.items():
        if not spec.tunnel:
            continue
        part = parts[name]
        carrier = transports.get(spec.tunnel)
        if carrier is None:
            hint = did_you_mean(spec.tunnel, transports, "transports")
            text = f"there is no transport {spec.tunnel!r}"
            problems.error(part, "unknown-transport", text, at="tunnel", hint=hint)
        elif carrier.type not in CARRIERS:
            text = f"{spec.tunnel!r} has the type {carrier.type}, which cannot be a tunnel"
            hint = f"possible types: {', '.join(sorted(CARRIERS))}"
            problems.error(part, "wrong-form", text, at="tunnel", hint=hint)
        elif _is_circular(name, transports):
            text = f"{name!r} tunnels through itself"
            problems.error(part, "wrong-form", text, at="tunnel", hint="break the circle")
        else:
            carriers.add(spec.tunnel)
    return carriers


def _is_circular(name: str, transports: Mapping[str, TransportSpec]) -> bool:
    seen = {name}
    through = transports[name].tunnel
    while through in transports:
        if through in seen:
            return True
        seen.add(through)
        through = transports[through].tunnel
    return False
