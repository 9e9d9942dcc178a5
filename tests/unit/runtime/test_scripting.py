"""Driving a robot from a script, up to the socket."""

import pytest

import urc
from urc.client.local import ConnectedRobot, connect
from urc.problems import UrcError
from urc.runtime.session import Session
from urc.testing.clock import FakeClock, settle
from urc.testing.profile import line_profile
from urc.testing.transport import MemoryTransport, table_of

pytestmark = pytest.mark.anyio


def test_the_two_names_are_at_the_top() -> None:
    """``from urc import connect, load`` is the documented way in."""
    assert urc.connect is connect
    assert callable(urc.load)


async def test_robot_in_a_script_gives_readings_and_replies() -> None:
    """Commands return values, `latest` a sample, `watch` every change; unknown names are told."""
    clock, line = FakeClock(), MemoryTransport(answer=lambda data: [b"42\n"] * data.count(b"Give"))
    settings = {"host": "h", "port": 1}
    async with Session(
        line_profile(every_s=None), settings, table_of(tcp=line), clock=clock
    ) as session:
        robot = ConnectedRobot(session)
        assert robot.latest("battery") is None
        assert await robot.command("ask") == {"battery": 42}
        sample = robot.latest("battery")
        assert sample is not None
        assert (sample.value, robot.state("wire")) == (42, "live")
        watching = robot.watch("note")
        line.feed(b"note one\n")
        assert (await anext(watching)).value == "one"
        line.feed(b"note two\n", b"note three\n")
        await settle()
        assert (await anext(watching)).value == "three"
        await watching.aclose()
        with pytest.raises(UrcError, match="unknown signal 'nix'; expected one of: battery, note"):
            robot.latest("nix")
        with pytest.raises(UrcError, match="unknown transport 'nix'; expected one of: wire"):
            robot.state("nix")


WRONG = [
    ({}, "liner needs a value for: port"),
    ({"prot": 1}, "liner has no setting 'prot'; did you mean 'port'?"),
    ({"port": True}, "--set port: 'true' is not a port from 1 to 65535"),
]


@pytest.mark.parametrize(("settings", "message"), WRONG)
async def test_wrong_settings_are_told_before_anything_is_opened(
    settings: dict[str, int], message: str
) -> None:
    """The same words as on the command line."""
    with pytest.raises(UrcError) as told:
        async with connect(line_profile(), **settings):
            pytest.fail("it opened")
    assert str(told.value) == message
