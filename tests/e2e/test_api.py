"""The HTTP API with a real server, a real guard and an emulated robot."""

import asyncio
import os
import re
import signal
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
import yaml
from anyio import to_thread

from tests.e2e.api_server import ApiServer, started, streaming
from tests.e2e.processes import UrcProcess
from urc.runtime.recording.reader import open_recording

pytestmark = pytest.mark.anyio

Start = Callable[..., UrcProcess]
UNHURRIED_S = 10.0
"""Time limit of a wait, on a machine that runs other tests too."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiServer]:
    """One server for all tests of this module."""
    folder = tmp_path_factory.mktemp("api")
    processes: list[UrcProcess] = []

    def start(*arguments: str) -> UrcProcess:
        processes.append(UrcProcess(arguments, {}))
        return processes[-1]

    try:
        yield started(start, folder, "--record", str(folder / "recordings"))
    finally:
        for process in processes:
            process.kill()


@pytest.fixture
async def api(server: ApiServer) -> AsyncIterator[httpx2.AsyncClient]:
    async with server.client() as client:
        yield client


async def taken(client: httpx2.AsyncClient) -> dict[str, Any]:
    """Take the controls of the cart, as soon as it is connected."""
    until = time.monotonic() + UNHURRIED_S
    while (await client.get("robots/cart/signals/battery")).json()["value"] is None:
        assert time.monotonic() < until, "the cart is not connected"
        await asyncio.sleep(0.05)
    answer = await client.post("robots/cart/lease", json={"verb": "take"})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def motion(lease: dict[str, Any], number: int, beat: int, **more: object) -> dict[str, Any]:
    session, epoch = lease["session"], lease["epoch"]
    asked = {"session": session, "epoch": epoch, "number": number, "beat": beat}
    return {**asked, "command": "drive", "arguments": {"speed": 0.5}, **more}


async def driven(client: httpx2.AsyncClient, lease: dict[str, Any], seconds: float) -> int:
    """Drive for some time without a pause; return the number of inputs.

    After a pause of a busy machine, the input is refused. The controls are then taken again.
    """
    beat, number = lease["beat"], 0
    began = time.monotonic()
    until = began + seconds
    while time.monotonic() < until:
        number += 1
        answer = await client.post("robots/cart/motion", json=motion(lease, number, beat))
        if answer.status_code == 409 and until < began + UNHURRIED_S:
            take = {"verb": "take", "session": lease["session"]}
            answer = await client.post("robots/cart/lease", json=take)
            lease.update(answer.json())
            until = time.monotonic() + seconds
        assert answer.status_code == 200, answer.text
        beat = answer.json()["beat"]
        await asyncio.sleep(0.04)
    return number


async def speed(client: httpx2.AsyncClient) -> float:
    value: float = (await client.get("robots/cart/signals/speed")).json()["value"]
    return value


async def until_speed(client: httpx2.AsyncClient, wanted: float) -> None:
    """Wait for a speed."""
    began = time.monotonic()
    while await speed(client) != wanted:
        assert time.monotonic() - began < UNHURRIED_S, f"the speed is {await speed(client)}"
        await asyncio.sleep(0.01)


# ---- descriptions


async def test_robots_are_listed_for_those_who_may_watch(
    server: ApiServer, api: httpx2.AsyncClient
) -> None:
    """Robots without a right are not even named."""
    robots = (await api.get("robots")).json()["robots"]
    assert [(one["name"], one["tags"], one["role"]) for one in robots] == [
        ("cart", ["lab"], "administer"),
        ("other", [], "administer"),
    ]
    _, token = server.token("drive@#lab")
    async with server.client(token) as program:
        robots = (await program.get("robots")).json()["robots"]
        assert [(one["name"], one["role"]) for one in robots] == [("cart", "drive")]
        refused = await program.get("robots/other")
        assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
    async with server.client("") as nobody:
        refused = await nobody.get("robots")
        assert (refused.status_code, refused.json()["code"]) == (401, "unauthorized")


async def test_a_robot_tells_its_commands_and_signals(
    server: ApiServer, api: httpx2.AsyncClient
) -> None:
    """With units, limits, roles, and whether this visitor may give each command."""
    found = (await api.get("robots/cart")).json()
    commands = {one["name"]: one for one in found["commands"]}
    drive = commands["drive"]
    assert drive["hold"] == {"period_s": 0.05, "lease_s": 0.25, "release": {"speed": 0}}
    (argument,) = drive["arguments"]
    assert (argument["unit"], argument["min"], argument["max"]) == ("m/s", -1, 1)
    assert [commands[one]["role"] for one in ("drive", "tune")] == ["drive", "maintain"]
    assert commands["twice"]["sequence"]
    assert commands["erase"]["confirm"]["text"] == "The map will be lost"
    signals = {one["name"]: one for one in found["signals"]}
    assert (signals["battery"]["unit"], signals["battery"]["limits"]) == ("%", {"low": 20})
    _, token = server.token("drive@cart", commands=("echo", "tune"))
    async with server.client(token) as program:
        found = (await program.get("robots/cart")).json()
    assert [one["name"] for one in found["commands"] if one["allowed"]] == ["echo"]


async def test_the_document_is_whole_and_names_no_folder(
    server: ApiServer, api: httpx2.AsyncClient
) -> None:
    answer = await api.get("robots/cart/document")
    assert answer.headers["content-type"].startswith("application/yaml")
    document = yaml.safe_load(answer.text)
    assert (document["name"], document["tags"]) == ("cart", ["lab"])
    assert "/" not in "".join(re.findall(r"# .*", answer.text))
    _, token = server.token("drive")
    async with server.client(token) as program:
        assert (await program.get("robots/cart/document")).status_code == 403


# ---- signals


async def test_signals_have_values_and_ages(api: httpx2.AsyncClient) -> None:
    """The first call connects the robot, and waits for a first value."""
    found = (await api.get("robots/cart/signals", params={"signals": "battery,never"})).json()
    battery = found["values"]["battery"]
    assert 40 <= battery["value"] < 60
    assert battery["age_s"] < 3
    assert not battery["stale"]
    assert found["values"]["never"] == {
        "value": None, "age_s": None, "stale": True, "alarm": "",
    }  # fmt: skip
    missing = await api.get("robots/cart/signals/nothing")
    assert (missing.status_code, missing.json()["code"]) == (404, "unknown-signal")
    (robot, _) = (await api.get("robots")).json()["robots"]
    assert robot["state"] == "live"


async def test_a_stream_sends_changes_until_the_right_ends(server: ApiServer) -> None:
    """Another process removes the token; the benchmark `motion_revoked` measures the time."""
    program, token = server.token("watch@cart")
    async with (
        server.client(token) as client,
        streaming(client, "robots/cart/stream?signals=battery") as events,
    ):
        assert list(await events.until("connections")) == ["wire"]
        values = await events.until("values")
        assert list(values["values"]) == ["battery"]
        server.begin_to_remove(program)
        began = time.monotonic()
        end = await events.until("end")
        assert time.monotonic() - began < UNHURRIED_S
        assert "right" in end["reason"]
        assert (await events.next())[0] == "over"
        assert (await client.get("robots/cart")).status_code == 401


# ---- commands


async def test_a_command_gives_its_reply(api: httpx2.AsyncClient) -> None:
    answer = await api.post("robots/cart/commands/echo", json={"arguments": {"word": "hello"}})
    assert (answer.status_code, answer.json()) == (200, {"values": {"word": "hello"}})
    assert (await api.post("robots/cart/commands/twice")).json() == {"values": {}}


@pytest.mark.parametrize(
    ("command", "body", "status", "code"),
    [
        ("echo", {"arguments": {"word": "a", "times": 10}}, 422, "bad-argument"),
        ("echo", {"arguments": {"word": "a\nM 1"}}, 422, "bad-argument"),
        ("echo", {}, 422, "bad-argument"),
        ("echo", {"argument": {}}, 400, "bad-request"),
        ("nothing", {}, 404, "unknown-command"),
        ("drive", {"arguments": {"speed": 1}}, 409, "held"),
        ("mute", {"timeout_s": 0.2}, 424, "timed-out"),
        ("erase", {}, 428, "not-confirmed"),
        ("arm", {"confirmed": True}, 428, "needs-two-people"),
    ],
)
async def test_a_command_that_fails_tells_why(
    api: httpx2.AsyncClient, command: str, body: dict[str, Any], status: int, code: str
) -> None:
    answer = await api.post(f"robots/cart/commands/{command}", json=body)
    assert (answer.status_code, answer.json()["code"]) == (status, code), answer.text


async def test_a_confirmed_command_is_sent(api: httpx2.AsyncClient) -> None:
    answer = await api.post("robots/cart/commands/erase", json={"confirmed": True})
    assert answer.status_code == 200, answer.text


async def test_a_token_gives_only_commands_of_its_scope_and_role(server: ApiServer) -> None:
    """The role of a command counts, too."""
    _, token = server.token("drive@cart", commands=("echo", "tune"))
    async with server.client(token) as program:
        body = {"arguments": {"word": "a"}}
        assert (await program.post("robots/cart/commands/echo", json=body)).status_code == 200
        for command in ("tune", "launch"):
            refused = await program.post(f"robots/cart/commands/{command}")
            assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
    _, token = server.token("maintain@cart")
    async with server.client(token) as program:
        assert (await program.post("robots/cart/commands/tune")).status_code == 200
    _, token = server.token("watch@cart")
    async with server.client(token) as program:
        refused = await program.post("robots/cart/commands/echo", json=body)
        assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")


async def test_stop_blocks_moving_commands_until_the_reset(api: httpx2.AsyncClient) -> None:
    """Anybody may press STOP; the interlock is the same as a page's."""
    until = time.monotonic() + UNHURRIED_S
    while not (await api.post("robots/cart/stop")).json()["confirmed"]:
        # A busy machine needs longer than one answer waits to connect the robot again.
        assert time.monotonic() < until, "the robot did not receive the stop"
    refused = await api.post("robots/cart/commands/launch")
    assert (refused.status_code, refused.json()["code"]) == (409, "refused")
    assert "Stopped by" in refused.json()["message"]
    reset = await api.post("robots/cart/lease", json={"verb": "reset"})
    assert (reset.status_code, reset.json()["latched"]) == (200, "")
    left = await api.post(
        "robots/cart/lease", json={"verb": "leave", "session": reset.json()["session"]}
    )
    assert left.json()["session"] == ""
    assert (await api.post("robots/cart/commands/launch")).status_code == 200


# ---- motion


async def test_motion_stops_when_the_requests_end(api: httpx2.AsyncClient) -> None:
    """Silence longer than the lease stops the robot, without any further request."""
    lease = await taken(api)
    assert lease["drives"]
    assert await driven(api, lease, 0.6) > 5
    assert await speed(api) == 0.5
    await until_speed(api, 0)
    later = motion(lease, 1000, lease["beat"])
    refused = await api.post("robots/cart/motion", json=later)
    assert (refused.status_code, refused.json()["code"]) == (409, "refused")
    leave = {"verb": "leave", "session": lease["session"]}
    assert (await api.post("robots/cart/lease", json=leave)).status_code == 200


async def test_letting_go_stops_the_robot(api: httpx2.AsyncClient) -> None:
    lease = await taken(api)
    number = await driven(api, lease, 0.3)
    release = motion(lease, number + 1, 0, release=True)
    assert (await api.post("robots/cart/motion", json=release)).status_code == 200
    await until_speed(api, 0)
    leave = {"verb": "leave", "session": lease["session"]}
    assert (await api.post("robots/cart/lease", json=leave)).status_code == 200


async def test_only_one_program_drives(server: ApiServer, api: httpx2.AsyncClient) -> None:
    """A session belongs to its visitor, and its holder blocks others."""
    lease = await taken(api)
    _, token = server.token("drive@cart")
    async with server.client(token) as program:
        refused = await program.post("robots/cart/lease", json={"verb": "take"})
        assert (refused.status_code, refused.json()["code"]) == (409, "refused")
        stolen = await program.post("robots/cart/motion", json=motion(lease, 1, lease["beat"]))
        assert (stolen.status_code, stolen.json()["code"]) == (404, "no-session")
        blocked = await program.post("robots/cart/commands/launch")
        assert "has the controls" in blocked.json()["message"]
    body = {"session": lease["session"]}
    assert (await api.post("robots/cart/commands/launch", json=body)).status_code == 200
    leave = {"verb": "leave", "session": lease["session"]}
    assert (await api.post("robots/cart/lease", json=leave)).status_code == 200


async def test_a_revoked_token_stops_the_robot(server: ApiServer, api: httpx2.AsyncClient) -> None:
    """Another process removes the program; then the controls are free."""
    program, token = server.token("drive@cart")
    async with server.client(token) as client:
        lease = await taken(client)
        number = await driven(client, lease, 0.3)
        server.begin_to_remove(program)
        began = time.monotonic()
        while (await api.get("robots/cart/controls")).json()["holder"]:
            assert time.monotonic() - began < UNHURRIED_S
        later = motion(lease, number + 1, lease["beat"])
        assert (await client.post("robots/cart/motion", json=later)).status_code == 401
    await until_speed(api, 0)


# ---- recordings


async def test_a_program_records_and_downloads(
    server: ApiServer, api: httpx2.AsyncClient, tmp_path: Path
) -> None:
    """Only with the right to maintain the recorded robot."""
    begun = await api.post("robots/cart/recordings/start")
    assert begun.status_code == 200, begun.text
    file = begun.json()["file"]
    again = await api.post("robots/cart/recordings/start")
    assert (again.status_code, again.json()["code"]) == (409, "recording")
    while (await api.get("robots/cart/recordings")).json()["messages"] < 5:
        assert (await api.get("robots/cart/recordings")).json()["active"]
    ended = (await api.post("robots/cart/recordings/stop")).json()
    assert not ended["active"]
    listed = (await api.get("recordings")).json()["recordings"]
    assert file in [one["file"] for one in listed if one["robot"] == "cart"]
    copy = tmp_path / file
    copy.write_bytes((await api.get(f"recordings/{file}")).content)
    assert any("battery" in one.topic for one in open_recording(copy).messages(0))
    _, token = server.token("maintain@other", "drive@cart")
    async with server.client(token) as program:
        assert [one["robot"] for one in (await program.get("recordings")).json()["recordings"]] in (
            [],
            ["other"],
        )
        assert (await program.get(f"recordings/{file}")).status_code == 404
        assert (await program.post("robots/cart/recordings/start")).status_code == 403
    for name in ("..%2Fcart.yaml", "cart.yaml", "cart-20260101T000000Z.mcap"):
        assert (await api.get(f"recordings/{name}")).status_code == 404
    audit = (await api.get("audit", params={"what": "recording", "text": file})).json()
    told = [(one["command"], one["robot"], one["who"]) for one in reversed(audit["entries"])]
    who = told[0][2]
    assert who
    assert told == [(step, "cart", who) for step in ("started", "ended", "downloaded")]
    assert {one["way"] for one in audit["entries"]} == {"key"}


async def test_the_server_ends_with_open_streams(tmp_path: Path) -> None:
    """Without a wait for readers, and without a fault in its output."""
    process: list[UrcProcess] = []

    def start(*arguments: str) -> UrcProcess:
        process.append(UrcProcess(arguments, {}))
        return process[-1]

    server = started(start, tmp_path)
    try:
        async with (
            server.client() as client,
            streaming(client, "robots/cart/stream?signals=battery") as events,
        ):
            await events.until("values")
            began = time.monotonic()
            os.kill(process[0].pid, signal.SIGTERM)
            end = await events.until("end")
            assert "server" in end["reason"]
            assert (await events.next())[0] == "over"
        assert await to_thread.run_sync(process[0].wait) == 0
        assert time.monotonic() - began < 5
        assert process[0].errors == []
    finally:
        process[0].kill()
