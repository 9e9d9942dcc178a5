"""`urc watch`, `urc send` and `urc record` at a robot of a server."""

import asyncio
import json
import os
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.open_robots import STOPPED, Cart, carted, served_robot, until
from urc.runtime.recording.reader import open_recording
from urc.testing.entry import KEY

pytestmark = pytest.mark.anyio

WRONG_TOKEN = "no-such-token"  # noqa: S105 - it opens nothing
ROOT = Path(__file__).resolve().parents[2]


@asynccontextmanager
async def server(folder: Path) -> AsyncIterator[tuple[Cart, list[str]]]:
    """Serve a cart; give it, and the options that lead to it."""
    file = folder / "token"
    file.write_text(KEY + "\n", "ascii")
    async with carted(folder) as (cart, profile), served_robot(profile) as address:
        yield cart, ["--server", address, "--token-file", str(file)]


async def started(*words: str, **environment: str) -> Process:
    """Start `urc`."""
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "urc.cli.main",
        *words,
        cwd=ROOT,
        env=os.environ | {"PYTHONUNBUFFERED": "1"} | environment,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )


async def ran(*words: str, **environment: str) -> tuple[int, str, str]:
    """Run `urc` to its end; return its code and what it said."""
    process = await started(*words, **environment)
    out, err = await process.communicate()
    return process.returncode or 0, out.decode(), err.decode()


async def test_send_prints_the_reply(tmp_path: Path) -> None:
    """As for a robot that it connects itself."""
    async with server(tmp_path) as (cart, options):
        assert await ran("send", "cart", "ask", *options) == (
            0,
            '{"command": "ask", "values": {"level": 7}}\n',
            "",
        )
        code, _, err = await ran("send", "cart", "say", "word=hello there", *options)
        assert (code, err) == (0, "")
        assert "say hello there" in cart.lines


async def test_send_holds_a_command_for_a_time(tmp_path: Path) -> None:
    """And returns after the stop."""
    async with server(tmp_path) as (cart, options):
        code, _, err = await ran("send", "cart", "drive", "speed=0.5", "--hold", "400ms", *options)
        assert (code, err) == (0, "")
        moves = [line for line in cart.lines if line.startswith("V")]
        assert moves[0] == "V 0.5 0"
        assert moves[-1] == STOPPED


WRONG = [
    (["drive"], "drive moves the robot while held: add a duration, such as --hold 1s"),
    (["ask", "--hold", "1s"], "ask is not a held command: remove --hold"),
    (["nix"], "nix failed (unknown-command): there is no command 'nix'"),
    (["say", "word"], "expected ARG=VALUE, found 'word'"),
    (["ask", "--set", "host=h"], "--set does not work with --server"),
    (["ask", "--despite-stop"], "--despite-stop does not work with --server"),
]


@pytest.mark.parametrize(("words", "told"), WRONG)
async def test_wrong_use_is_told(words: list[str], told: str, tmp_path: Path) -> None:
    """With the code of wrong use."""
    async with server(tmp_path) as (cart, options):
        code, out, err = await ran("send", "cart", *words, *options)
        assert (code, out) == (2, "")
        assert told in err
        assert cart.lines == []


async def test_watch_prints_the_present_readings_and_new_ones(tmp_path: Path) -> None:
    """Only the named signals."""
    async with server(tmp_path) as (cart, options):
        watching = await started("watch", "cart", "level", "--for", "20s", *options)
        assert watching.stdout is not None
        try:
            await until(lambda: cart.has_line)
            cart.say("note not asked for", "level 5")
            first = json.loads(await watching.stdout.readline())
            cart.say("level 6")
            second = json.loads(await watching.stdout.readline())
        finally:
            watching.terminate()
            await watching.communicate()
        assert [(one["signal"], one["value"]) for one in (first, second)] == [
            ("level", 5),
            ("level", 6),
        ]


async def test_record_writes_the_readings(tmp_path: Path) -> None:
    """The file opens, and has the robot's name."""
    file = tmp_path / "cart.mcap"
    async with server(tmp_path) as (cart, options):
        recording = await started("record", "cart", "--for", "2s", "-o", str(file), *options)
        assert recording.stderr is not None
        first = await recording.stderr.readline()
        assert first.endswith(b"Ctrl-C ends it\n")
        await until(lambda: cart.has_line)
        cart.say("level 5", "level 6", "level 7")
        out, err = await recording.communicate()
        assert (recording.returncode, err) == (0, b"")
    assert b"1 signal, 0 pieces of traffic" in out
    found = open_recording(file, has_profile=True)
    topics = [one.topic for one in found.messages(0) if one.topic.startswith("/signals/")]
    assert topics
    assert set(topics) == {"/signals/level"}
    assert found.document == ""


async def test_the_token_may_come_from_the_environment(tmp_path: Path) -> None:
    """Which other users cannot read."""
    async with carted(tmp_path) as (_, profile), served_robot(profile) as address:
        where = ("send", "cart", "ask", "--server", address)
        assert (await ran(*where, URC_TOKEN=KEY))[0] == 0
        code, _, err = await ran(*where, URC_TOKEN=WRONG_TOKEN)
        assert code == 1
        assert "does not accept the token: it is unknown, removed or expired" in err
        assert WRONG_TOKEN not in err


@pytest.mark.parametrize("verb", ["watch", "send", "record"])
async def test_no_command_takes_a_token_in_its_words(verb: str) -> None:
    """Every user of a computer can read the words of all processes."""
    words = [verb, "cart", *(["ask"] if verb == "send" else [])]
    code, _, err = await ran(*words, "--server", "http://127.0.0.1:1", "--token", "secret")
    assert code == 2
    assert "unrecognized arguments: --token" in err


UNREACHABLE = [
    (["--server", "http://robots.lab:8080"], "would send the token without encryption"),
    (["--server", "ftp://robots.lab"], "expected an address like https://robots.lab:8080"),
    (["--server", "https://robots.lab?key=abc"], "expected an address without a key"),
    (["--token-file", "x"], "--token-file needs --server"),
    (["--server", "http://127.0.0.1:1", "--token-file", "no/such/file"], "cannot use no/such/file"),
]


@pytest.mark.parametrize(("options", "told"), UNREACHABLE)
async def test_an_address_or_token_that_cannot_be_used_is_told(
    options: list[str], told: str
) -> None:
    """Before anything is sent."""
    code, _, err = await ran("send", "cart", "ask", *options)
    assert code in (1, 2)
    assert told in err
