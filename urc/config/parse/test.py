"""Parser for a document's tests: mapping → `DocumentTest`."""

from typing import Final

from urc.config.node import Node, Problems
from urc.config.parse.forms.stamped import stamped_body, stamped_type
from urc.model.payload import Envelope
from urc.model.profile import DialogueStep, DocumentTest, Expected, ExpectedState, Fed
from urc.model.values import Value

__all__ = ["parse_test"]

_AT_ONCE: Final = ("feed", "reply_to", "run", "args", "expect", "sent", "fails")
"""Keys that are valid only in a test without steps."""
_IN_STEPS: Final = ("polls", "ready")
"""Keys that are valid only in a test with steps."""
_VERBS: Final = (
    "message", "response", "feedback", "publish", "call", "goal", "cancel", "request",
    "get",
)  # fmt: skip
"""Keys for the kinds of messages in a test."""
_ADDRESS: Final = (
    "topic", "type", "service", "action", "method", "path", "url", "query", "headers", "qos",
    "retain", "ok", "status", "reason", "parameters",
)  # fmt: skip
"""Keys of a message that are not part of its body: its address, options and status."""
_BODIES: Final = ("json", "text", "hex")
"""Keys for a message's body."""
_HAPPENS: Final = ("feed", "run", "wait", "connects", "closes", "leaves")
"""Keys for the action of a step; a step may have only one of them."""


def parse_test(part: Node, problems: Problems) -> DocumentTest:
    """Return the test at `part`, with unresolved names."""
    line, column, source = _place(part)
    reply_to = part.scalar("reply_to")
    if isinstance(reply_to, float):
        reply_to = int(reply_to)
    _check_keys(part, problems)
    return DocumentTest(
        name=part.text("name"),
        line=line,
        feed=_fed(part, "feed", problems),
        reply_to=reply_to,
        run=part.text("run") or None,
        arguments=_values(part, "args"),
        expect=_expected(part),
        sent=_fed(part, "sent", problems),
        fails=part.text("fails") or None,
        file=part.document.source_of(part.path).file,
        column=column,
        source=source,
        settings={name: inner.data for name, inner in part.named("settings").items()},
        steps=tuple(_step(inner, problems) for inner in part.listed("steps")),
        polls=tuple(str(inner.data) for inner in part.listed("polls")),
        is_ready=part.flag("ready", default=False),
    )


def _check_keys(part: Node, problems: Problems) -> None:
    has_steps = "steps" in part.data
    for key in _AT_ONCE if has_steps else _IN_STEPS:
        if key in part.data:
            why = "must be a key of one of the steps" if has_steps else "needs 'steps'"
            problems.error(part, "misplaced-key", f"'{key}' {why}", at=key, key=True)


def _step(part: Node, problems: Problems) -> DialogueStep:
    happens = [key for key in _HAPPENS if part.data.get(key, False) is not False]
    if len(happens) > 1:
        problems.error(
            part,
            "two-verbs",
            f"'{happens[0]}' and '{happens[1]}' are two actions in one step",
            at=happens[1],
            key=True,
            hint="write two steps",
        )
    if "of" in part.data and not {"reply", "fails"} & part.data.keys():
        text = "'of' needs 'reply' or 'fails'"
        problems.error(part, "misplaced-key", text, at="of", key=True)
    line, column, source = _place(part)
    wait = part.get("wait")
    return DialogueStep(
        line=line,
        column=column,
        source=source,
        feed=_fed(part, "feed", problems),
        run=part.text("run"),
        arguments=_values(part, "args"),
        wait_s=problems.duration(part, "wait", 0.0) if wait else None,
        connects=part.text("connects"),
        closes=part.text("closes"),
        leaves=part.flag("leaves", default=False),
        sent=_fed(part, "sent", problems),
        expect=_expected(part),
        reply=_values(part, "reply") if "reply" in part.data else None,
        of=part.text("of"),
        fails=part.text("fails"),
        closed=part.text("closed"),
    )


def _place(part: Node) -> tuple[int, int, str]:
    """Return the line number, the column number and the text of the line of `part`."""
    mark, home = part.document.at(part.path), part.document.source_of(part.path)
    line, column = (mark.span.line, mark.span.column) if mark else (1, 1)
    return line, column, home.lines[line - 1]


def _values(part: Node, key: str) -> dict[str, Value | tuple[Value, ...]]:
    return {name: _value(inner) for name, inner in part.named(key).items()}


def _value(part: Node) -> Value | tuple[Value, ...]:
    return tuple(part.data) if isinstance(part.data, list) else part.data


def _expected(part: Node) -> dict[str, Expected]:
    return {name: _state(inner) for name, inner in part.named("expect").items()}


def _state(part: Node) -> Expected:
    if not isinstance(part.data, dict):
        return _value(part)
    value, alarm = part.get("value"), part.text("alarm")
    return ExpectedState(
        has_value=value is not None,
        value=None if value is None else _value(value),
        alarm=None if not alarm else "" if alarm == "none" else alarm,  # type: ignore[arg-type]  # the schema's enum
        age=part.text("age"),  # type: ignore[arg-type]  # as above
    )


def _fed(part: Node, key: str, problems: Problems) -> dict[str, Fed | tuple[Fed, ...]]:
    return {name: _pieces(inner, problems) for name, inner in part.named(key).items()}


def _pieces(part: Node, problems: Problems) -> Fed | tuple[Fed, ...]:
    if isinstance(part.data, list):
        return tuple(_wire(inner, problems) for inner in part.items())
    return _wire(part, problems)


def _wire(part: Node, problems: Problems) -> Fed:
    """Return the data of the key ``feed``: text, bytes (key ``hex``) or a message."""
    if not isinstance(part.data, dict):
        return str(part.data)
    inner = part.get("hex")
    return _message(part, problems) if inner is None else _hex(inner, problems)


def _message(part: Node, problems: Problems) -> Envelope:
    verb, inner = next((verb, one) for verb in _VERBS if (one := part.get(verb)) is not None)
    bodies = [key for key in _BODIES if key in inner.data]
    if len(bodies) > 1:
        text = f"'{bodies[0]}' and '{bodies[1]}' both define the body of one message"
        problems.error(inner, "two-forms", text, at=bodies[1], key=True)
    body: object = None
    for key in bodies:
        value = inner.must(key)
        if key == "json":
            body = value.data
        else:
            body = _hex(value, problems) if key == "hex" else str(value.data).encode()
    given = ((name, inner.get(name)) for name in _ADDRESS)
    attributes = {name: one.data for name, one in given if one is not None}
    is_stamped = inner.get("stamped")
    if is_stamped is not None and is_stamped.data:
        kind = stamped_type(inner, attributes.get("type"), problems)
        if kind is not None:
            attributes["type"], body = kind, stamped_body(kind, body)
    return Envelope(verb, attributes, body)


def _hex(inner: Node, problems: Problems) -> bytes:
    try:
        return bytes.fromhex(inner.data)
    except ValueError:
        text = "expected pairs of hex digits"
        hint = "write each byte as two digits, such as 02 FF 0D"
        problems.error(inner, "not-hex", text, hint=hint)
        return b""
