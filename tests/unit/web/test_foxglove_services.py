"""Commands as services: their schemas, and the requests that are accepted."""

import json
from typing import Any

import pytest

from urc.model.driver import Argument, Command, Driver, Hold, Reply, TransportSpec
from urc.model.exchange import Confirm
from urc.model.payload import ReadSpec
from urc.model.values import Signal
from urc.testing.profile import text
from urc.web.foxglove.services import BadRequest, RobotServiceType, request_of, robot_services


def command(name: str, **more: Any) -> Command:
    return Command(name, "wire", text(name), **more)


SPEED = Argument("speed", "number", unit="m/s", min=-1, max=1)
ARGUMENTS = {
    "word": Argument("word", "string", choices=("a", "b")),
    "times": Argument("times", "integer", default=2),
    "path": Argument("path", "array", items="number", size=3, max=9),
}
COMMANDS = (
    command("say", arguments=ARGUMENTS, reply=Reply(ReadSpec("json", fields=("level", "_other")))),
    command("drive", arguments={"speed": SPEED}, hold=Hold(0.05, release={"speed": 0})),
    command("erase", confirm=Confirm(text="All is lost")),
    command("arm", confirm=Confirm(is_two_person=True)),
    command("tune", role="maintain"),
)
DRIVER = Driver(
    {"wire": TransportSpec("wire", "tcp")},
    {"level": Signal("level", "integer")},
    {one.name: one for one in COMMANDS},
)


def services() -> dict[str, RobotServiceType]:
    found = robot_services("cart", DRIVER)
    return {one.name: one for one in found}


def test_held_commands_and_commands_of_two_people_are_not_offered() -> None:
    assert list(services()) == ["/cart/say", "/cart/erase", "/cart/tune", "/cart/STOP"]


def test_a_robot_that_cannot_move_has_no_stop() -> None:
    driver = DRIVER._replace(commands={"say": DRIVER.commands["say"]})
    assert [one.name for one in robot_services("cart", driver)] == ["/cart/say"]


def test_the_schemas_come_from_the_declared_arguments_and_reply() -> None:
    said = services()["/cart/say"]
    assert json.loads(said.request) == {
        "title": "urc.Command.say.Request",
        "type": "object",
        "properties": {
            "word": {"type": "string", "enum": ["a", "b"]},
            "times": {"type": "integer", "default": 2},
            "path": {
                "type": "array",
                "items": {"type": "number", "maximum": 9},
                "minItems": 3,
                "maxItems": 3,
            },
        },
        "required": ["word", "path"],
    }
    assert json.loads(said.response)["properties"] == {"level": {"type": "integer"}}


def test_a_confirmation_is_a_field_of_the_request() -> None:
    fields = json.loads(services()["/cart/erase"].request)["properties"]
    assert fields["_confirmed"]["type"] == "boolean"
    assert "All is lost" in fields["_confirmed"]["description"]
    assert request_of(b'{"_confirmed": true}') == ({}, True)


def test_a_request_is_the_arguments() -> None:
    assert request_of(b'{"word": "a", "path": [1, 2.5, 3]}') == (
        {"word": "a", "path": (1, 2.5, 3)},
        False,
    )
    assert request_of(b"") == ({}, False)


@pytest.mark.parametrize(
    "data",
    [
        b"[]",
        b"{",
        b"\xff",
        b'{"word": {"a": 1}}',
        b'{"_confirmed": "yes"}',
        b'{"word": ' + b"[" * 5000,
        b'{"word": [[1]]}',
    ],
)
def test_any_other_request_is_refused(data: bytes) -> None:
    with pytest.raises(BadRequest, match="expected a JSON object with the arguments"):
        request_of(data)
