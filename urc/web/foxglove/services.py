"""A robot's commands as Foxglove services.

Layer 5. Pure. Held commands are not offered, because a call cannot report that the operator has
released the control. STOP is a service of every robot that can move. Command names are in lower
case, so no command can have the name ``STOP``.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import msgspec

from urc.model.driver import Argument, Command, Driver
from urc.model.exchange import Confirm
from urc.runtime.json_messages import argument_property, object_schema, signal_property
from urc.runtime.one_shot_commands import can_move
from urc.wire.client_messages import Arguments

__all__ = ["CONFIRMED", "STOP", "BadRequest", "RobotServiceType", "request_of", "robot_services"]

STOP: Final = "STOP"
CONFIRMED: Final = "_confirmed"
"""Request field that states whether a person has confirmed the command. No argument can have this
name, because the names of arguments begin with a letter."""

_arguments: Final = msgspec.json.Decoder(dict[str, Any])


class BadRequest(Exception):
    """The request is not a JSON object of arguments; the message is one line of text."""


class RobotServiceType(NamedTuple):
    """One service of a robot."""

    name: str
    """Name of the service, such as ``/cart/echo``."""
    command: str
    """Name of the command, or `STOP`."""
    type: str
    request: str
    """JSON Schema of the request, as JSON text."""
    response: str


def robot_services(robot: str, driver: Driver) -> tuple[RobotServiceType, ...]:
    """Return a robot's services for a visitor with all roles; `robot` is the robot's name in URLs.

    Each visitor is offered `STOP` and only the commands that the visitor may run.
    """
    found = [
        _service(robot, one, driver)
        for one in driver.commands.values()
        if one.hold is None and not _needs_two_people(one.confirm)
    ]
    if can_move(driver):
        answer = {"latched": {"type": "string"}, "confirmed": {"type": "boolean"}}
        name = f"urc.{STOP}"
        request, response = _schema(f"{name}.Request", {}), _schema(f"{name}.Response", answer)
        found.append(RobotServiceType(f"/{robot}/{STOP}", STOP, name, request, response))
    return tuple(found)


def request_of(data: bytes) -> tuple[Arguments, bool]:
    """Return a request's arguments and whether a person has confirmed the command.

    Args:
        data: JSON text; empty text means no arguments.

    Raises:
        BadRequest: the text is not a JSON object, or an argument has an unsupported type.
    """
    try:
        fields = _arguments.decode(data) if data.strip() else {}
        is_confirmed = msgspec.convert(fields.pop(CONFIRMED, False), bool)
        return msgspec.convert(fields, Arguments), is_confirmed
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise BadRequest(f"expected a JSON object with the arguments: {error}") from None


def _service(robot: str, command: Command, driver: Driver) -> RobotServiceType:
    name = f"urc.Command.{command.name}"
    fields = {each: _argument(one) for each, one in command.arguments.items()}
    if command.confirm is not None or any(one.confirm for one in command.arguments.values()):
        texts = [one.text for one in _questions(command) if one.text]
        about = " ".join(dict.fromkeys(("Whether a person has confirmed the command.", *texts)))
        fields[CONFIRMED] = {"type": "boolean", "description": about, "default": False}
    reply = {
        each: signal_property(driver.signals[each])
        for each in _reply_names(command)
        if each in driver.signals
    }
    return RobotServiceType(
        f"/{robot}/{command.name}",
        command.name,
        name,
        _schema(f"{name}.Request", fields, _required(command)),
        _schema(f"{name}.Response", reply),
    )


def _questions(command: Command) -> Iterable[Confirm]:
    if command.confirm is not None:
        yield command.confirm
    for argument in command.arguments.values():
        yield from argument.confirm.values()


def _required(command: Command) -> list[str]:
    arguments = command.arguments.values()
    return [one.name for one in arguments if one.is_required and one.default is None]


def _argument(argument: Argument) -> dict[str, Any]:
    """Return the schema of an argument with its limits, which apply to each element of an array."""
    found: dict[str, Any] = argument_property(argument)
    one = found["items"] if argument.type == "array" else found
    if argument.min is not None:
        one["minimum"] = argument.min
    if argument.max is not None:
        one["maximum"] = argument.max
    if argument.choices:
        one["enum"] = list(argument.choices)
    if argument.type == "array" and argument.size is not None:
        found["minItems"] = found["maxItems"] = argument.size
    about = " ".join(filter(None, (argument.title or argument.description, argument.unit)))
    if about:
        found["description"] = about
    if argument.default is not None:
        found["default"] = argument.default
    return found


def _reply_names(command: Command) -> Iterable[str]:
    if command.reply is None:
        return ()
    reads = (command.reply.read, *(stage.read for stage in command.reply.stages))
    return dict.fromkeys(name for read in reads for name in read.fields)


def _needs_two_people(confirm: Confirm | None) -> bool:
    return confirm is not None and confirm.is_two_person


def _schema(name: str, fields: Mapping[str, object], required: Iterable[str] = ()) -> str:
    schema = dict(object_schema(name, fields).schema)
    if needed := list(required):
        schema["required"] = needed
    return json.dumps(schema)
