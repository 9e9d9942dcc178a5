"""Goals that outlive their connection to the emulated bridge, and STOP after the loss."""

import asyncio
import json
import os
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path

import pytest
from websockets.asyncio.client import connect

from tests.e2e.transports.leaks import nothing_left
from urc.config.load import load_profile
from urc.guard.pipe_channel import PipeChannel
from urc.model.profile import Profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.simulator.server import serve as serve_robot
from urc.transports.ros import choice

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
DOCKER = """
urc: 1
kind: robot
name: docker
title: Docker
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 9090 }
transports:
  ros: { type: ros, host: "{{ settings.host }}", port: "{{ settings.port }}", stale_after: 2s }
signals:
  going: { type: boolean }
messages:
  state: { subscribe: { topic: /state, type: my_msgs/State }, json: { going: going } }
commands:
  dock:
    moves: true
    send: { goal: { action: /dock, type: my_msgs/action/Dock, json: {} } }
    reply: { json: { _docked: docked }, timeout: 60s }
  stop_docking: { stop: true, send: { cancel: { action: /dock } } }
simulator:
  signals: { going: false }
  ros:
    - name: go
      command: dock
      set: { going: true }
      then: [{ until: not going, answer: refused }]
    - { name: cancel, command: stop_docking, set: { going: false } }
    - { name: state, every: 100ms, message: state }
"""


@asynccontextmanager
async def emulated(profile: Profile) -> AsyncIterator[int]:
    settings = {"host": "127.0.0.1", "port": 0}
    async with serve_robot(profile, settings) as listening:
        yield listening["ros"].port


@pytest.mark.parametrize("in_outage", [False, True])
async def test_stop_ends_a_goal_that_outlived_its_connection(
    tmp_path: Path, in_outage: bool
) -> None:
    """The emulated robot drives on after the loss, as a real one does, until the goal's cancel."""
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    rover = load_profile(path, built_in_catalog())
    async with nothing_left(), emulated(rover) as port, cable(port) as (near, cut):
        settings = {"host": "127.0.0.1", "port": near}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "going") is False)
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            cut()
            with pytest.raises(CommandFailed):
                await docking
            if not in_outage:
                await until(session, lambda: session.hub.links["ros"].state == "live")
                await asyncio.sleep(0.3)
                assert value(session, "going") is True
            async with asyncio.timeout(WAIT_S):
                while True:  # as STOP does, until the command has been sent
                    with suppress(CommandFailed):
                        await session.command("stop_docking", {})
                        break
                    await asyncio.sleep(0.1)
            await until(session, lambda: value(session, "going") is False)
            assert not [note.text for note in session.hub.notes if "is cancelled" in note.text]


async def test_a_cancellation_that_the_bridge_drops_is_repeated_on_the_same_connection(
    tmp_path: Path,
) -> None:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER.replace("stale_after: 2s", "stale_after: 9s"))
    rover = load_profile(path, built_in_catalog())
    lost = asyncio.Event()
    async with nothing_left(), emulated(rover) as port, cable(port, lost) as (near, _):
        settings = {"host": "127.0.0.1", "port": near}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "going") is False)
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            lost.set()
            since = session.goals.number
            assert session.goals.answer("ros", "/dock", since) == "unsent"
            await session.command("stop_docking", {})
            await asyncio.sleep(0.3)
            lost.clear()
            assert session.goals.answer("ros", "/dock", since) == "owed"
            with pytest.raises(CommandFailed, match="the action was cancelled"):
                await docking
            assert session.hub.links["ros"].state == "live"
            await until(session, lambda: value(session, "going") is False)
            assert session.goals.answer("ros", "/dock", since) == "answered"


async def test_stop_ends_a_goal_that_was_sent_to_another_port_of_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With `via: auto`, the bridge may come back on the port of the other kind."""
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    rover = load_profile(path, built_in_catalog())
    path.write_text(DOCKER.replace('port: "{{ settings.port }}"', "via: auto"))
    auto = load_profile(path, built_in_catalog())
    async with (
        nothing_left(),
        emulated(rover) as port,
        cable(port) as (second, _),
        AsyncExitStack() as first_cable,
    ):
        first, cut = await first_cable.enter_async_context(cable(port))
        monkeypatch.setitem(choice.PORTS, "auto", (first, second))  # type: ignore[arg-type]
        settings = {"host": "127.0.0.1", "port": 1}
        async with Session(auto, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "going") is False)
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            cut()
            await first_cable.aclose()
            with pytest.raises(CommandFailed):
                await docking
            await until(session, lambda: session.hub.links["ros"].state == "live")
            await session.command("stop_docking", {})
            await until(session, lambda: value(session, "going") is False)


GUARDED = DOCKER.replace(
    "  stop_docking:",
    """  drive:
    args: { speed: { type: number, min: -1, max: 1 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ speed }}" } }
    hold: { repeat: 100ms, release: { speed: 0 } }
  stop_docking:""",
)


@pytest.mark.parametrize("is_pressed_first", [False, True], ids=["killed first", "STOP first"])
async def test_stop_ends_a_goal_that_was_started_through_a_guard_that_was_killed(
    tmp_path: Path, is_pressed_first: bool
) -> None:
    """The new guard learns the goals and cancellations of the guard before it from the server."""
    path = tmp_path / "rover.yaml"
    path.write_text(GUARDED)
    rover = load_profile(path, built_in_catalog())
    lost = asyncio.Event()
    async with nothing_left(), emulated(rover) as port, cable(port, lost) as (near, _):
        settings = {"host": "127.0.0.1", "port": near}
        transports = built_in_catalog().transports
        async with Session(rover, settings, transports, motion="guarded") as session:
            await until(session, lambda: value(session, "going") is False)
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            if is_pressed_first:
                lost.set()
                await session.command("stop_docking", {})
                await asyncio.sleep(0.2)
            assert session.backend is not None
            assert isinstance(session.backend.channel, PipeChannel)
            os.kill(session.backend.channel.pid, signal.SIGKILL)
            with pytest.raises(CommandFailed):
                await docking
            lost.clear()
            await until(session, lambda: session.hub.links["ros"].state == "live")
            if not is_pressed_first:
                await asyncio.sleep(0.5)
                assert value(session, "going") is True
                await session.command("stop_docking", {})
            await until(session, lambda: value(session, "going") is False)
            # The result went to the lost connection, so it is not known whether the goal ended.
            assert session.goals.answer("ros", "/dock", 0) == "owed"


async def test_the_emulated_bridge_takes_a_cancel_from_any_client_but_no_unknown_id(
    tmp_path: Path,
) -> None:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "a/Dock"}
    async with nothing_left(), emulated(load_profile(path, built_in_catalog())) as port:
        url = f"ws://127.0.0.1:{port}"
        async with connect(url) as one, connect(url) as other:
            await one.send(json.dumps({**goal, "args": {}}))
            await one.send(
                json.dumps({"op": "call_service", "id": "c", "service": "/rosapi/topics"})
            )
            assert json.loads(await one.recv())["id"] == "c"
            for number in ("send_action_goal:/dock:1", "g1"):
                cancel = {"op": "cancel_action_goal", "id": number, "action": "/dock"}
                await other.send(json.dumps(cancel))
            async with asyncio.timeout(WAIT_S):
                result = json.loads(await one.recv())
            assert (result["op"], result["id"], result["status"]) == ("action_result", "g1", 5)
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.3):
                    await other.recv()


async def until(session: Session, fits: Callable[[], bool]) -> None:
    with session.hub.subscribe() as news:
        async with asyncio.timeout(WAIT_S):
            while not fits():
                await news.changed()
                news.changes()


def value(session: Session, name: str) -> object:
    found = session.hub.latest(name)
    return None if found is None else found.value


@asynccontextmanager
async def cable(
    port: int, loses: asyncio.Event | None = None, flows: asyncio.Event | None = None
) -> AsyncIterator[tuple[int, Callable[[], None]]]:
    """Carry connections to `port`; yield the near port, and a function that cuts them all.

    While `loses` is set, data is accepted and lost. While `flows` is not set, data waits.
    """
    ends: list[asyncio.StreamWriter] = []

    async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65536):
                if flows is not None:
                    await flows.wait()
                if loses is None or not loses.is_set():
                    writer.write(data)
        writer.close()

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", port)
        ends.extend((writer, far_writer))
        await asyncio.gather(carry(reader, far_writer), carry(far_reader, writer))

    def cut() -> None:
        for end in ends:
            end.transport.abort()
        ends.clear()

    async with await asyncio.start_server(meet, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1], cut
        cut()
