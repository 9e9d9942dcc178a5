"""SSH against OpenSSH's server: programs, what goes through it, and a server that goes away."""

import asyncio

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.ssh_lines import OPEN_S, end_of, hears, line_to, public_folder, refusal
from tests.e2e.transports.sshd import PASSWORD, USER, Sshd
from urc.transports.base import ConnectFailed, PeerClosed, TransportSetup
from urc.transports.ssh import from_setup

pytestmark = [pytest.mark.anyio, pytest.mark.needs("sshd")]

GONE_WITHIN_S = 40.0
"""A server that does not answer is asked every 2 s, and given up after the third time."""


# ---- what runs at the far end


async def test_shell_without_a_terminal_says_nothing_but_answers(sshd: Sshd) -> None:
    """No prompt, no echo."""
    line = line_to(sshd, pty=False)
    async with nothing_left():
        await line.open(OPEN_S)
        await line.send(b"echo $((6*7))\n")
        assert await hears(line, b"\n") == b"42\n"
        await line.close()


async def test_shell_with_a_terminal_prompts_and_echoes(sshd: Sshd) -> None:
    """As a person would see it."""
    line = line_to(sshd)
    await line.open(OPEN_S)
    await line.send(b"echo $((6*7))\n")
    seen = await hears(line, b"42\r\n")
    assert b"echo $((6*7))\r\n" in seen
    assert b"$ " in seen
    await line.close()


async def test_command_is_the_line(sshd: Sshd) -> None:
    """Its standard input and output, every byte of them, for as long as the connection."""
    every_byte = bytes(range(256)) * 1000
    line = line_to(sshd, mode="exec", command="cat")
    await line.open(OPEN_S)
    sending = asyncio.ensure_future(line.send(every_byte))
    got = b""
    async with asyncio.timeout(OPEN_S):
        while len(got) < len(every_byte):
            got += await line.receive()
    await sending
    assert got == every_byte
    await line.close()


async def test_what_is_not_taken_yet_is_known(sshd: Sshd) -> None:
    """A command that does not read holds up the sender, and says how much there is."""
    line = line_to(sshd, mode="exec", command="sleep 60")
    await line.open(OPEN_S)
    assert line.unsent() == 0
    sending = asyncio.ensure_future(line.send(b"x" * 5_000_000))
    done, _ = await asyncio.wait([sending], timeout=1.0)
    assert not done
    assert line.unsent() > 1_000_000
    sending.cancel()
    await line.close()
    assert line.unsent() == 0


async def test_command_that_ends_tells_how(sshd: Sshd) -> None:
    """What it said last comes with it, after all that it has written."""
    line = line_to(sshd, mode="exec", command="echo depth 1; echo no such port >&2; exit 3")
    await line.open(OPEN_S)
    assert await hears(line, b"\n") == b"depth 1\n"
    assert await end_of(line) == "the command ended with status 3 (no such port)"
    with pytest.raises(PeerClosed, match="ended with status 3"):
        await line.send(b"?\n")
    await line.close()


async def test_command_that_is_killed_tells_it(sshd: Sshd) -> None:
    """By name of the signal."""
    line = line_to(sshd, mode="exec", command="kill -9 $$")
    await line.open(OPEN_S)
    assert await end_of(line) == "the command was ended by signal KILL"
    await line.close()


async def test_environment_reaches_the_command(tmp_path_factory: pytest.TempPathFactory) -> None:
    """As far as the server takes it (AcceptEnv)."""
    sshd = Sshd(public_folder(tmp_path_factory))
    await sshd.start()
    try:
        line = line_to(
            sshd, mode="exec", command='echo "$GREETING"', environment={"GREETING": "hello robot"}
        )
        await line.open(OPEN_S)
        assert await hears(line, b"\n") == b"hello robot\n"
        await line.close()
    finally:
        sshd.kill()


# ---- a server that goes away


async def test_killed_server_is_told_and_reached_again_when_it_is_back(sshd: Sshd) -> None:
    """On the line itself and on what goes through it."""
    line = line_to(sshd, mode="exec", command="cat")
    async with nothing_left():
        await line.open(OPEN_S)
        through = await line.connect("127.0.0.1", sshd.port, OPEN_S)
        assert (await through.read()).startswith(b"SSH-2.0")
        sshd.kill()
        assert await end_of(line) in (
            "the robot closed the connection",
            "the connection broke (connection reset by peer)",
            "the connection broke (broken pipe)",  # Linux reports a late reset so
        )
        with pytest.raises(PeerClosed):
            await through.read()
        with pytest.raises(PeerClosed):
            await through.write(b"?")
        await through.abort()
        await line.close()
        said = await refusal(line)
        assert said == f"nothing listens on 127.0.0.1:{sshd.port} (connection refused)"
        await sshd.start()
        await line.open(OPEN_S)
        await line.send(b"back\n")
        assert await hears(line, b"\n") == b"back\n"
        await line.close()


@pytest.mark.parametrize("mode", ["exec", "forward"])
async def test_frozen_server_is_noticed(sshd: Sshd, mode: str) -> None:
    """Its sockets stay open and take bytes, but nobody answers any more."""
    command = {"command": "cat"} if mode == "exec" else {}
    line = line_to(sshd, mode=mode, **command)
    async with nothing_left():
        await line.open(OPEN_S)
        sshd.stop()
        said = await end_of(line, GONE_WITHIN_S)
        assert said == "the connection broke (the robot no longer answers)"
        await line.close()
        with pytest.raises(ConnectFailed) as told:
            await line.open(0.5)
        assert str(told.value) == f"no answer from 127.0.0.1:{sshd.port} within 0.5 s"


# ---- carrying others


async def test_one_connection_carries_everything(sshd: Sshd) -> None:
    """Ten that come at once, before there is any, share one login; the last to leave closes it."""
    line = line_to(sshd, mode="forward")
    async with nothing_left():
        streams = await asyncio.gather(
            *(line.connect("127.0.0.1", sshd.port, OPEN_S) for _ in range(10))
        )
        for stream in streams:
            assert (await stream.read()).startswith(b"SSH-2.0")
        assert sshd.said.count("Accepted password") == 1
        for stream in streams[:9]:
            await stream.abort()
        again = await line.connect("127.0.0.1", sshd.port, OPEN_S)
        assert sshd.said.count("Accepted password") == 1
        await again.abort()
        await streams[9].abort()
        await streams[9].abort()
        anew = await line.connect("127.0.0.1", sshd.port, OPEN_S)
        assert sshd.said.count("Accepted password") == 2
        await anew.abort()


async def test_who_gives_up_waiting_does_not_hold_up_the_others(sshd: Sshd) -> None:
    """Cancelled while the connection is being opened, or while the far end connects."""
    line = line_to(sshd, mode="forward")
    async with nothing_left():
        for pause_s in (0.0, 0.01, 0.03, 0.1):
            one = asyncio.ensure_future(line.connect("127.0.0.1", sshd.port, OPEN_S))
            other = asyncio.ensure_future(line.connect("127.0.0.1", sshd.port, OPEN_S))
            await asyncio.sleep(pause_s)
            one.cancel()
            stream = await other
            assert (await stream.read()).startswith(b"SSH-2.0")
            await stream.abort()
            if not one.cancelled() and one.done() and one.exception() is None:
                await one.result().abort()


async def test_what_the_server_cannot_reach_is_told(sshd: Sshd) -> None:
    """And the connection stays for the others."""
    line = line_to(sshd, mode="forward")
    await line.open(OPEN_S)
    with pytest.raises(ConnectFailed) as told:
        await line.connect("127.0.0.1", 1, OPEN_S)
    assert str(told.value) == (
        f"cannot connect to 127.0.0.1:1 through ssh 127.0.0.1:{sshd.port} (connection refused)"
    )
    await (await line.connect("127.0.0.1", sshd.port, OPEN_S)).abort()
    with pytest.raises(PeerClosed, match="only tunnels other connections"):
        await line.send(b"?")
    await line.close()


async def test_ssh_goes_through_ssh(sshd: Sshd) -> None:
    """Each with a key and a login of its own; the inner one dies with the outer one."""
    outer = line_to(sshd, mode="forward")
    options = {
        "host": "127.0.0.1", "port": sshd.port, "username": USER, "password": PASSWORD,
        "mode": "exec", "command": "cat", "host_key": sshd.fingerprint,
    }  # fmt: skip
    inner = from_setup(TransportSetup("inner", options, tunnel=outer))
    async with nothing_left():
        for _ in range(2):
            await inner.open(OPEN_S)
            await inner.send(b"deep\n" * 10_000)
            got = b""
            while len(got) < 50_000:
                got += await inner.receive()
            assert got == b"deep\n" * 10_000
            await inner.close()
        await inner.open(OPEN_S)
        sshd.kill()
        await end_of(inner)
        await inner.close()
