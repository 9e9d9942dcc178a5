"""Validation of command arguments and their encoding as a frame.

Pure. All arguments from browsers, scripts and tests are checked here.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from urc.expressions import NONCE, NOW, ExpressionError, Template, quoted
from urc.model.driver import MOST_ELEMENTS, Argument, Command
from urc.model.payload import Payload, WriteSpec, each_of
from urc.model.values import NOTHING, Reading, Value
from urc.problems import UrcError, printable
from urc.protocol.forms.table import build_writer
from urc.protocol.framing.base import Framing, FramingError
from urc.protocol.values.payload import CodecContext, NotWritable

__all__ = ["BadArgument", "Encode", "build_check", "build_encode", "check_arguments"]

Encode = Callable[[Mapping[str, object]], Payload]
"""Function that encodes the values of a namespace to framed bytes or an envelope."""

_LARGEST = 1e308
"""Maximum finite value. A comparison with this value also rejects infinity and not-a-number."""


class BadArgument(UrcError):
    """An invalid command argument, with the name of the argument in the message."""


def build_encode(
    send: WriteSpec,
    framing: Framing,
    context: CodecContext,
    arguments: Mapping[str, Argument] = NOTHING,
) -> Encode:
    """Return a function that encodes and frames `send`; constant frames are encoded once.

    The frames in a group are joined, so they are sent together.
    """
    if send.form == "frames":
        return _together([build_encode(one, framing, context, arguments) for one in each_of(send)])
    writer = build_writer(send, context)

    def encode(namespace: Mapping[str, object]) -> Payload:
        try:
            payload = writer.write(namespace)
            return framing.encode(payload) if isinstance(payload, bytes) else payload
        except (ExpressionError, FramingError, NotWritable) as error:
            raise BadArgument(str(error)) from None

    if (send.names & {NOW, NONCE}) - arguments.keys():
        return lambda namespace: encode({**context.fresh.names(), **namespace})
    if not send.names:
        constant = encode({})
        return lambda _: constant
    template = send.options.get("template")
    if context.is_compiled and send.form == "text" and isinstance(template, Template):
        from urc.protocol.requests.compiled_encode import build_fast_encode

        return build_fast_encode(template, arguments, framing, context.encoding, encode) or encode
    return encode


def _together(encodes: Sequence[Encode]) -> Encode:
    def encode(namespace: Mapping[str, object]) -> Payload:
        pieces = [one(namespace) for one in encodes]
        return b"".join(one for one in pieces if isinstance(one, bytes))

    return encode


def build_check(
    command: Command, *, is_compiled: bool = False
) -> Callable[[Mapping[str, object]], dict[str, Reading]]:
    """Return a function that checks the arguments of one command."""
    check = partial(check_arguments, command)
    if not is_compiled:
        return check
    from urc.protocol.requests.compiled_encode import build_fast_check

    return build_fast_check(command.arguments, check)


def check_arguments(command: Command, given: Mapping[str, object]) -> dict[str, Reading]:
    """Return the checked arguments including defaults; raise `BadArgument` if invalid."""
    for name in given:
        if name not in command.arguments:
            known = ", ".join(command.arguments) or "none"
            raise BadArgument(f"{command.name} has no argument {name!r}; it has: {known}")
    values: dict[str, Reading] = {}
    for name, argument in command.arguments.items():
        if name in given:
            values[name] = _checked(argument, given[name])
        elif argument.is_required:
            raise BadArgument(f"{command.name} needs the argument {name!r}")
        else:
            values[name] = argument.default
    return values


def _checked(argument: Argument, value: object) -> Reading:
    return _elements(argument, value) if argument.type == "array" else _one(argument, value)


def _elements(argument: Argument, value: object) -> tuple[Value, ...]:
    """Check each element of an array argument; return the elements as a list."""
    name, wanted = argument.name, argument.size
    if not isinstance(value, (list, tuple)):
        raise BadArgument(f"{name}: expected a list, found {quoted(value)}")
    if wanted is not None and len(value) != wanted:
        raise BadArgument(f"{name}: expected {wanted} elements, found {len(value)}")
    if len(value) > MOST_ELEMENTS:
        raise BadArgument(f"{name}: expected at most {MOST_ELEMENTS} elements, found {len(value)}")
    return tuple(
        _one(argument._replace(name=f"{name}[{place}]", type=argument.items), element)
        for place, element in enumerate(value)
    )


def _one(argument: Argument, value: object) -> Value:
    checked = _typed(argument, value)
    if argument.choices and checked not in argument.choices:
        choices = ", ".join(map(repr, argument.choices))
        raise BadArgument(f"{argument.name}: {quoted(value)} is not one of {choices}")
    if isinstance(checked, (int, float)) and not isinstance(checked, bool):
        if argument.min is not None and checked < argument.min:
            raise BadArgument(f"{argument.name}: {checked} is below its minimum {argument.min}")
        if argument.max is not None and checked > argument.max:
            raise BadArgument(f"{argument.name}: {checked} is above its maximum {argument.max}")
    return checked


def _typed(argument: Argument, value: object) -> Value:
    match argument.type, value:
        case "boolean", bool():
            return value
        case "integer", int() if not isinstance(value, bool):
            return value
        case "integer", float() if value.is_integer():
            return int(value)
        case "number", int() | float() if not isinstance(value, bool) and abs(value) <= _LARGEST:
            return value
        case "string", str():
            if not argument.allows_control and value != printable(value):
                raise BadArgument(
                    f"{argument.name}: {quoted(value)} has control characters, which could end"
                    " the frame and start another"
                )
            return value
    raise BadArgument(f"{argument.name}: expected {argument.type}, found {quoted(value)}")
