"""One interface of a robot, with two openings: the same dialogues in this process and by a server.

Every test runs against both, so a program may move from one to the other in one line.
"""

import asyncio
import inspect
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import get_args

import pytest

from tests.e2e.open_robots import Cart, Opening, opened
from urc.client import CommandFailed, ConnectedRobot, RemoteRobot
from urc.client.robot import RobotInterface
from urc.problems import UrcError

pytestmark = pytest.mark.anyio


@pytest.fixture(autouse=True)
def _own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No latch of this machine's user, and no running server, takes part."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


@pytest.fixture(params=get_args(Opening))
async def pair(
    request: pytest.FixtureRequest, tmp_path: Path
) -> AsyncIterator[tuple[Cart, RobotInterface]]:
    """Return a cart, and the robot of a program."""
    async with opened(request.param, tmp_path) as both:
        yield both


Pair = tuple[Cart, RobotInterface]


@pytest.mark.parametrize("kind", [ConnectedRobot, RemoteRobot])
def test_both_openings_have_the_whole_interface(kind: type) -> None:
    """Same names, same parameters: a member that one of them lacks is a hole in the contract."""
    names = [name for name in vars(RobotInterface) if not name.startswith("_")]
    assert len(names) >= 14
    for name in names:
        wanted, found = inspect.getattr_static(RobotInterface, name), getattr(kind, name)
        if not isinstance(wanted, property):
            ours = inspect.signature(found).parameters.values()
            theirs = inspect.signature(wanted).parameters.values()
            assert [(one.name, one.kind, one.default) for one in ours] == [
                (one.name, one.kind, one.default) for one in theirs
            ], name


# -- readings


async def test_the_newest_reading_of_a_signal(pair: Pair) -> None:
    """With its time on this process's clock; unknown names are told."""
    cart, robot = pair
    assert robot.latest("level") is None
    before_s = time.monotonic()
    cart.say("level 41", "level 42")
    sample = await robot.wait_for("level", lambda value: value == 42, timeout=5)
    assert (sample.signal, sample.value) == ("level", 42)
    assert before_s - 0.05 <= sample.time_s <= time.monotonic() + 0.05
    assert robot.latest("level") == sample
    with pytest.raises(UrcError, match="unknown signal 'nix'; expected one of: level, note"):
        robot.latest("nix")
    with pytest.raises(UrcError, match="unknown transport 'nix'; expected one of: wire"):
        robot.state("nix")


async def test_signals_say_what_they_are(pair: Pair) -> None:
    """Type and unit, in the order of the document."""
    _, robot = pair
    assert list(robot.signals) == ["level", "note", "odometer"]
    assert (robot.signals["level"].type, robot.signals["level"].unit) == ("integer", "%")
    assert (robot.name, robot.controls) == ("cart", ("drive",))


async def test_a_large_integer_stays_an_integer(pair: Pair) -> None:
    """Beyond 2^53, where a browser's numbers end."""
    cart, robot = pair
    cart.say(f"odometer {2**60 + 1}")
    sample = await robot.wait_for("odometer", timeout=5)
    assert sample.value == 2**60 + 1


async def test_a_wait_has_a_time_limit(pair: Pair) -> None:
    """And the present reading counts."""
    cart, robot = pair
    with pytest.raises(TimeoutError):
        await robot.wait_for("level", timeout=0.1)
    cart.say("level 5")
    await robot.wait_for("level", timeout=5)
    assert (await robot.wait_for("level", timeout=0.1)).value == 5


async def test_a_stream_gives_the_newest_to_a_slow_program(pair: Pair) -> None:
    """It skips readings, and never falls behind."""
    cart, robot = pair
    cart.say("level 1")
    await robot.wait_for("level", timeout=5)
    watching = robot.watch("level")
    assert (await anext(watching)).value == 1
    cart.say(*(f"level {number}" for number in range(2, 100)))
    await robot.wait_for("level", lambda value: value == 99, timeout=5)
    seen = []
    async with asyncio.timeout(5):
        async for sample in watching:
            seen.append(sample.value)
            if sample.value == 99:
                break
    assert len(seen) < 50
    await watching.aclose()  # type: ignore[attr-defined]


async def test_a_stream_of_an_unknown_signal_is_refused(pair: Pair) -> None:
    """At its first step."""
    _, robot = pair
    with pytest.raises(UrcError, match="unknown signal 'nix'"):
        await anext(robot.watch("nix"))


async def test_every_line_of_the_log_arrives(pair: Pair) -> None:
    """In order, from the call on."""
    cart, robot = pair
    lines = robot.log()
    cart.cut()
    async with asyncio.timeout(5):
        entry = await anext(lines)
    assert entry.source == "transport wire"
    assert entry.level in ("warning", "error")


# -- commands


async def test_a_command_gives_the_values_of_its_reply(pair: Pair) -> None:
    """Typed as its signals."""
    _, robot = pair
    assert await robot.command("ask") == {"level": 7}
    assert await robot.command("say", word="hello there") == {}


async def test_commands_at_the_same_time_get_their_own_replies(pair: Pair) -> None:
    """Each call waits for its own."""
    cart, robot = pair
    await asyncio.gather(*(robot.command("say", word=f"w{number}") for number in range(8)))
    assert {line for line in cart.lines if line.startswith("say")} == {
        f"say w{number}" for number in range(8)
    }


FAILURES = [
    ("silent", {}, "timed-out"),
    ("nix", {}, "unknown-command"),
    ("say", {}, "bad-argument"),
    ("say", {"word": {"a": 1}}, "bad-argument"),
    ("drive", {}, "refused"),
]


@pytest.mark.parametrize(("name", "arguments", "code"), FAILURES)
async def test_a_failure_has_a_code(
    pair: Pair, name: str, arguments: dict[str, str], code: str
) -> None:
    """The same for both."""
    _, robot = pair
    with pytest.raises(CommandFailed) as told:
        await robot.command(name, **arguments)
    assert told.value.code == code
    assert told.value.message


async def test_the_robots_own_error_is_told(pair: Pair) -> None:
    """As a refusal of the robot."""
    cart, robot = pair
    cart.is_broken = True
    with pytest.raises(CommandFailed) as told:
        await robot.command("ask")
    assert told.value.code == "refused"


async def test_the_call_of_a_program_confirms_a_command(pair: Pair) -> None:
    """A confirmation guards a finger that slips; a line of a program does not slip."""
    cart, robot = pair
    await robot.command("erase")
    assert "erase" in cart.lines
