"""Goals that outlive their connection to the emulated bridge, and STOP after the loss."""

import asyncio
import json
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from tests.e2e.transports.leaks import nothing_left
from urc.config.load import load_profile
from urc.guard.pipe_channel import PipeChannel
from urc.model.profile import Profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Motion, Session
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
            await answered(session, 0)


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
            await answered(session, since)


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
            await answered(session, 0)


@pytest.mark.parametrize("motion", ["none", "guarded"])
async def test_stop_ends_a_goal_of_another_program_or_of_an_earlier_server(
    tmp_path: Path, motion: Motion
) -> None:
    """URC knows no id. The sender is a client of the bridge that does not exist any more."""
    path = tmp_path / "rover.yaml"
    path.write_text(GUARDED)
    rover = load_profile(path, built_in_catalog())
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "a/Dock"}
    async with nothing_left(), emulated(rover) as port:
        async with connect(f"ws://127.0.0.1:{port}") as other:
            await other.send(json.dumps({**goal, "args": {}}))
            await other.send(json.dumps({"op": "call_service", "service": "/rosapi/topics"}))
            await other.recv()
        settings = {"host": "127.0.0.1", "port": port}
        transports = built_in_catalog().transports
        async with Session(rover, settings, transports, motion=motion) as session:
            await until(session, lambda: value(session, "going") is True)
            since = session.goals.number
            await session.command("stop_docking", {})
            await until(session, lambda: value(session, "going") is False)
            await answered(session, since)


class CancelService:
    """The hidden service of /dock, offered by roslibpy; the emulated bridge passes the calls on."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.requests: list[Any] = []
        self._process = process
        self._ready = asyncio.Event()

    async def listen(self) -> None:
        """Keep the requests."""
        assert self._process.stdout is not None
        async for line in self._process.stdout:
            if line.strip() == b"ready":
                self._ready.set()
            else:
                self.requests.append(json.loads(line))

    async def reply(self, reply: dict[str, Any] | None) -> None:
        """Set the reply to later requests; None lets the service fail."""
        assert self._process.stdin is not None
        self._ready.clear()
        self._process.stdin.write(json.dumps(reply).encode() + b"\n")
        async with asyncio.timeout(WAIT_S):
            await self._ready.wait()

    async def asked(self, count: int) -> None:
        """Wait for a number of requests."""
        await holds(lambda: len(self.requests) >= count)


@asynccontextmanager
async def cancel_service(port: int) -> AsyncIterator[CancelService]:
    script = Path(__file__).parent / "clients" / "roslibpy_cancel_service.py"
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        str(script),
        str(port),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    service = CancelService(process)
    listening = asyncio.create_task(service.listen())
    try:
        yield service
    finally:
        process.kill()
        await process.wait()
        await listening


REPLIES: dict[str, dict[str, Any] | None] = {
    "failure": None,
    "refusal": {"return_code": 1, "goals_canceling": []},
    "nonsense": {"return_code": "yes"},
}


@pytest.mark.parametrize("reply", REPLIES)
async def test_the_cancellation_of_all_goals_is_repeated_until_the_robot_answers(
    tmp_path: Path, reply: str
) -> None:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    rover = load_profile(path, built_in_catalog())
    async with nothing_left(), emulated(rover) as port, cancel_service(port) as robot:
        await robot.reply(REPLIES[reply])
        settings = {"host": "127.0.0.1", "port": port}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "going") is False)
            since = session.goals.number
            await session.command("stop_docking", {})
            await robot.asked(3)
            assert session.goals.answer("ros", "/dock", since) == "owed"
            await robot.reply({"return_code": 0, "goals_canceling": []})
            await answered(session, since)
            assert robot.requests == [{}] * len(robot.requests), "omitted fields are zero"
            count = len(robot.requests)
            await asyncio.sleep(1.5)
            assert len(robot.requests) == count


async def test_a_reply_without_goals_is_no_answer_while_another_programs_goal_goes_on(
    tmp_path: Path,
) -> None:
    """rclpy reports a refusal as success without goals; only the status shows the goal."""
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    rover = load_profile(path, built_in_catalog())
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "a/Dock"}
    async with nothing_left(), emulated(rover) as port, cancel_service(port) as robot:
        await robot.reply({"return_code": 0, "goals_canceling": []})
        settings = {"host": "127.0.0.1", "port": port}
        transports = built_in_catalog().transports
        async with (
            connect(f"ws://127.0.0.1:{port}") as other,
            Session(rover, settings, transports) as session,
        ):
            await other.send(json.dumps({**goal, "args": {}}))
            await until(session, lambda: value(session, "going") is True)
            since = session.goals.number
            await session.command("stop_docking", {})
            await robot.asked(2)
            assert session.goals.answer("ros", "/dock", since) == "owed"
            assert any("still follows a goal" in note.text for note in session.hub.notes)
            await other.send(
                json.dumps({"op": "cancel_action_goal", "id": "g1", "action": "/dock"})
            )
            await answered(session, since)


async def test_a_cancellation_without_an_answer_delays_neither_stops_nor_a_new_goal(
    tmp_path: Path,
) -> None:
    """Up to rosbridge 2.1, a service call blocks the connection that made it."""
    path = tmp_path / "rover.yaml"
    path.write_text(GUARDED)
    rover = load_profile(path, built_in_catalog())
    async with nothing_left(), emulated(rover) as port, one_by_one(port) as (near, blocked):
        settings = {"host": "127.0.0.1", "port": near}
        async with Session(rover, settings, built_in_catalog().transports) as session:
            await until(session, lambda: value(session, "going") is False)
            since = session.goals.number
            await session.command("stop_docking", {})
            await holds(lambda: bool(blocked))
            assert session.goals.answer("ros", "/dock", since) == "owed"
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            await session.command("stop_docking", {})
            with pytest.raises(CommandFailed, match="the action was cancelled"):
                await docking
            await until(session, lambda: value(session, "going") is False)
            assert session.goals.answer("ros", "/dock", since) == "owed"
            assert session.hub.links["ros"].state == "live"


@pytest.mark.parametrize("motion", ["none", "guarded"])
async def test_a_reset_ends_unanswered_cancellations_of_all_goals(
    tmp_path: Path, motion: Motion
) -> None:
    """Also on later connections, because each repetition would end new goals of all programs."""
    path = tmp_path / "rover.yaml"
    path.write_text(GUARDED)
    rover = load_profile(path, built_in_catalog())
    async with (
        nothing_left(),
        emulated(rover) as port,
        one_by_one(port) as (bridge, blocked),
        cable(bridge) as (near, cut),
    ):
        settings = {"host": "127.0.0.1", "port": near}
        transports = built_in_catalog().transports
        async with Session(rover, settings, transports, motion=motion) as session:
            await until(session, lambda: value(session, "going") is False)
            since = session.goals.number
            session.latch("Stopped by a test")
            await session.command("stop_docking", {})
            await holds(lambda: bool(blocked))
            assert session.goals.answer("ros", "/dock", since) == "owed"
            session.end_cancellations(["/other"])
            session.latch("")
            assert session.goals.answer("ros", "/dock", since) == "owed"
            session.end_cancellations(["/dock"])
            assert session.goals.answer("ros", "/dock", since) == "dropped", "no answer came"
            await asyncio.sleep(0.3)
            count = len(blocked)
            cut()
            await until(session, lambda: session.hub.links["ros"].state != "live")
            await until(session, lambda: session.hub.links["ros"].state == "live")
            docking = asyncio.create_task(session.command("dock", {}))
            await until(session, lambda: value(session, "going") is True)
            await asyncio.sleep(2.5)
            assert len(blocked) == count
            assert value(session, "going") is True
            async with connect(f"ws://127.0.0.1:{port}") as late:
                service = "/dock/_action/cancel_goal"
                call = {"op": "call_service", "service": service, "args": {}}
                await late.send(json.dumps(call))
                with pytest.raises(CommandFailed, match="such as that of STOP, late"):
                    await docking


@asynccontextmanager
async def one_by_one(port: int) -> AsyncIterator[tuple[int, list[str]]]:
    """Stand before a bridge that never answers a cancellation, and then reads nothing more.

    Yields the near port and the calls that block their connections.
    """
    blocked: list[str] = []

    async def meet(near: ServerConnection) -> None:
        async with connect(f"ws://127.0.0.1:{port}") as far:

            async def back() -> None:
                async for frame in far:
                    await near.send(frame)

            returning = asyncio.create_task(back())
            with suppress(ConnectionClosed):
                async for frame in near:
                    service = str(json.loads(frame).get("service"))
                    if service.endswith("/cancel_goal"):
                        blocked.append(service)
                        await near.wait_closed()
                        break
                    await far.send(frame)
            returning.cancel()

    async with serve(meet, "127.0.0.1", 0) as server:
        yield next(iter(server.sockets)).getsockname()[1], blocked


async def test_the_emulated_bridge_ends_the_goals_of_all_clients_for_a_zero_id_only(
    tmp_path: Path,
) -> None:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "a/Dock"}
    call = {"op": "call_service", "id": "c", "service": "/dock/_action/cancel_goal"}
    async with nothing_left(), emulated(load_profile(path, built_in_catalog())) as port:
        url = f"ws://127.0.0.1:{port}"
        async with connect(url) as one, connect(url) as other, asyncio.timeout(WAIT_S):
            await one.send(json.dumps({**goal, "args": {}}))
            uuid = {"goal_info": {"goal_id": {"uuid": [0] * 15 + [1]}}}
            await other.send(json.dumps({**call, "args": uuid}))
            assert json.loads(await other.recv())["values"]["return_code"] == 2
            await other.send(json.dumps({**call, "args": {}}))
            said = json.loads(await other.recv())
            assert (said["result"], said["values"]["return_code"]) == (True, 0)
            (listed,) = said["values"]["goals_canceling"]
            assert len(listed["goal_id"]["uuid"]) == 16
            result = json.loads(await one.recv())
            assert (result["op"], result["id"], result["status"]) == ("action_result", "g1", 5)
            await other.send(json.dumps({**call, "service": "/fly/_action/cancel_goal"}))
            assert json.loads(await other.recv())["result"] is False


async def test_the_emulated_bridge_latches_the_states_of_an_actions_goals(tmp_path: Path) -> None:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCKER)
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "a/Dock"}
    listen = {"op": "subscribe", "topic": "/dock/_action/status", "type": "a/GoalStatusArray"}
    async with nothing_left(), emulated(load_profile(path, built_in_catalog())) as port:
        url = f"ws://127.0.0.1:{port}"
        async with connect(url) as one, connect(url) as other, asyncio.timeout(WAIT_S):

            async def states() -> list[int]:
                said = json.loads(await other.recv())
                assert said["topic"] == "/dock/_action/status"
                return [each["status"] for each in said["msg"]["status_list"]]

            await other.send(json.dumps(listen))
            assert await states() == []
            await one.send(json.dumps({**goal, "args": {}}))
            assert await states() == [2]
            await other.send(json.dumps(listen))
            assert await states() == [2]
            await one.send(json.dumps({"op": "cancel_action_goal", "id": "g1", "action": "/dock"}))
            assert await states() == []


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


async def answered(session: Session, since: int) -> None:
    """Wait until the robot has answered the cancellation, as STOP does."""
    await holds(lambda: session.goals.answer("ros", "/dock", since) == "answered")


async def holds(is_so: Callable[[], bool]) -> None:
    ends_s = time.monotonic() + WAIT_S
    while not is_so():
        assert time.monotonic() < ends_s
        await asyncio.sleep(0.02)


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
