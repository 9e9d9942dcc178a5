"""The server as a Foxglove server, seen by Foxglove's own client and by hostile clients."""

import json
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx2
import jsonschema
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from tests.e2e.api_server import ApiServer, started
from tests.e2e.foxglove_viewer import Viewer
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from urc.transports.ros.foxglove_frames import FrameReader, MessageData, call_frame
from urc.wire.server_messages import CLOSE_BAD_MESSAGES, CLOSE_NOT_LET_IN, CLOSE_TOO_FAST

SDK, OLDER = "foxglove.sdk.v1", "foxglove.websocket.v1"
SOON_S = 10.0
SLOW_S = 4.0
CODES = (CLOSE_BAD_MESSAGES, CLOSE_TOO_FAST, 1009, 1006)
"""Codes for a hostile client; 1009 is the protocol's code for a message that is too large. The code
is lost (1006) if the client is still sending."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiServer]:
    """One server for all tests of this module."""
    processes: list[UrcProcess] = []

    def start(*arguments: str) -> UrcProcess:
        processes.append(UrcProcess(arguments, {}))
        return processes[-1]

    try:
        yield started(start, tmp_path_factory.mktemp("foxglove"))
    finally:
        for process in processes:
            process.kill()


def key_of(server: ApiServer) -> str:
    """Return the start key of the server."""
    return headers_for(server.address)["Authorization"].removeprefix("Bearer ")


def address(server: ApiServer, token: str = "") -> str:
    place = server.address.replace("http://", "ws://") + "api/v1/foxglove"
    return f"{place}?token={token}" if token else place


def client(
    server: ApiServer, token: str = "", subprotocol: str = SDK, **more: Any
) -> ClientConnection:
    """Connect a client that can send anything."""
    return connect(
        address(server, token),
        subprotocols=[Subprotocol(subprotocol)],
        proxy=None,
        close_timeout=1,
        **more,
    )


def disconnected(line: ClientConnection) -> int:
    """Read until the server closes the socket; return its code, or 1006 without one."""
    end_s = time.monotonic() + SOON_S
    while time.monotonic() < end_s:
        try:
            line.recv(SOON_S)
        except ConnectionClosed as closed:
            return closed.rcvd.code if closed.rcvd is not None else 1006
    raise AssertionError("the server has not closed the socket")


def operations(line: ClientConnection, op: str, wait_s: float = SOON_S) -> dict[str, Any]:
    """Return the next message with an operation."""
    end_s = time.monotonic() + wait_s
    while (left_s := end_s - time.monotonic()) > 0:
        message = line.recv(left_s)
        if isinstance(message, str):
            said: dict[str, Any] = json.loads(message)
            if said["op"] == op:
                return said
    raise AssertionError(f"no {op}")


# ---- Foxglove's client


@pytest.mark.parametrize("subprotocols", [(SDK,), (OLDER,), (OLDER, SDK)])
@pytest.mark.needs("node")
@pytest.mark.needs("ws-protocol")
@pytest.mark.cases(3)
def test_foxglove_sees_typed_topics_and_calls_services(
    server: ApiServer, subprotocols: tuple[str, ...]
) -> None:
    """Both names of the protocol, as Lichtblick and Foxglove offer them."""
    _, token = server.token("drive")
    with Viewer(address(server, token), *subprotocols) as viewer:
        assert viewer.until("open")["protocol"] == subprotocols[0]
        info = viewer.until("serverInfo")
        assert info["capabilities"] == ["services"]
        assert info["sessionId"]
        while "/other/level" not in viewer.channels or "/cart/echo" not in viewer.services:
            viewer.next()
        channel = viewer.channels["/cart/battery"]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
        value = json.loads(channel["schema"])["properties"]["value"]
        assert value == {"type": "integer", "description": "Battery %"}
        assert viewer.channels["/cart/urc/log"]["schemaName"] == "foxglove.Log"

        battery = viewer.subscribe("/cart/battery")
        message = viewer.until("message", subscription=battery)
        assert 40 <= message["value"]["value"] < 60
        assert abs(int(message["ns"]) / 1e9 - time.time()) < SOON_S

        assert viewer.call("/cart/echo", 1, word="hello")["value"] == {"word": "hello"}
        failure = viewer.call("/cart/echo", 2, word="hello", times=99)
        assert failure["message"] == "times: 99 is above its maximum 9"
        assert "a confirmation is missing" in viewer.call("/cart/erase", 3)["message"]
        assert viewer.call("/cart/erase", 4, _confirmed=True)["event"] == "response"

        viewer.ask("unsubscribe", subscription=battery)
        viewer.drain(0.5)
        assert not [one for one in viewer.drain(0.5) if one["event"] == "message"]
        assert not [one for one in viewer.events if one["event"] in ("error", "status")]


@pytest.mark.needs("node")
@pytest.mark.needs("ws-protocol")
def test_a_held_command_is_no_service_and_stop_is_one_for_everybody(server: ApiServer) -> None:
    _, token = server.token("watch@cart")
    with Viewer(address(server, token), OLDER) as viewer:
        while "/cart/STOP" not in viewer.services:
            viewer.next()
        assert list(viewer.services) == ["/cart/STOP"]
        assert not [topic for topic in viewer.channels if topic.startswith("/other")]
        answer = viewer.call("/cart/STOP", 7)
        assert answer["value"]["latched"]
    with httpx2.Client(base_url=server.address, trust_env=False) as api:
        headers = headers_for(server.address)
        said = api.get("api/v1/robots/cart/controls", headers=headers).json()
        assert said["latched"] == answer["value"]["latched"]
        _, driver = server.token("drive@cart")
        with Viewer(address(server, driver), SDK) as viewer:
            while "/cart/launch" not in viewer.services:
                viewer.next()
            assert "Stopped by" in viewer.call("/cart/launch", 1)["message"]
        reset = {"verb": "reset"}
        lease = api.post("api/v1/robots/cart/lease", json=reset, headers=headers)
        assert lease.json()["latched"] == ""


MAPPER = """\
urc: 1
kind: robot
name: mapper
title: Mapper
settings: { port: { type: port, default: 9090 } }
transports:
  ros: { type: ros, host: 127.0.0.1, port: "{{ settings.port }}", version: 2, stale_after: 3s }
signals:
  frames: { type: transform_tree, stale_after: 2s }
messages:
  transforms:
    subscribe: { topic: /tf, type: tf2_msgs/TFMessage, throttle: 200ms }
    json: { frames: "@" }
simulator:
  ros:
    - every: 200ms
      send:
        publish:
          topic: /tf
          type: tf2_msgs/TFMessage
          json:
            transforms:
              - header: { frame_id: map }
                child_frame_id: odom
                transform:
                  translation: { x: 2.5, y: -1, z: 0 }
                  rotation: { x: 0, y: 0, z: 0, w: 1 }
              - header: { frame_id: odom }
                child_frame_id: base
                transform:
                  translation: { x: 0, y: 0, z: 0.5 }
                  rotation: { x: 0, y: 0, z: 1, w: 0 }
"""


@pytest.mark.needs("node")
@pytest.mark.needs("ws-protocol")
def test_foxglove_gets_the_transforms_of_a_ros_robot(tmp_path: Path) -> None:
    processes: list[UrcProcess] = []

    def start(*arguments: str) -> UrcProcess:
        processes.append(UrcProcess(arguments, {}))
        return processes[-1]

    try:
        mapper = started(start, tmp_path, robots={"mapper": MAPPER})
        _, token = mapper.token("watch")
        with Viewer(address(mapper, token), SDK) as viewer:
            while "/mapper/urc/transforms" not in viewer.channels:
                viewer.next()
            channel = viewer.channels["/mapper/urc/transforms"]
            assert channel["schemaName"] == "foxglove.FrameTransforms"
            number = viewer.subscribe("/mapper/urc/transforms")
            message = viewer.until("message", subscription=number)["value"]
            jsonschema.validate(message, json.loads(channel["schema"]))
            names = [
                (one["parent_frame_id"], one["child_frame_id"]) for one in message["transforms"]
            ]
            assert names == [("mapper/map", "mapper/odom"), ("mapper/odom", "mapper/base")]
            first, second = message["transforms"]
            assert first["translation"] == {"x": 2.5, "y": -1, "z": 0}
            assert second["rotation"] == {"x": 0, "y": 0, "z": 1, "w": 0}
            assert abs(first["timestamp"]["sec"] - time.time()) < SOON_S
    finally:
        for process in processes:
            process.kill()


# ---- who may connect


def test_a_viewer_without_a_token_is_told_what_it_needs(server: ApiServer) -> None:
    for token in ("", "wrong"):
        headers = {} if token else {"origin": server.address.rstrip("/")}
        with client(server, token, additional_headers=headers) as line:
            said = operations(line, "status")
            assert said["level"] == 2
            assert "sign in" in said["message"]
            assert disconnected(line) == CLOSE_NOT_LET_IN


def test_only_the_token_opens_the_socket_to_a_page_of_another_site(server: ApiServer) -> None:
    foreign = {"origin": "https://viewer.example"}
    _, token = server.token("watch")
    with client(server, token, additional_headers=foreign) as line:
        assert operations(line, "serverInfo")
    signed_in = httpx2.get(
        server.address, params={"key": key_of(server)}, trust_env=False
    ).headers.get_list("set-cookie")
    cookie = signed_in[0].partition(";")[0]
    for more, used in (
        ({"cookie": cookie}, ""),  # a cookie that the browser adds by itself
        ({"cookie": cookie}, "wrong"),
        ({}, "wrong"),
        ({}, ""),
    ):
        with pytest.raises(InvalidStatus) as caught:
            client(server, used, additional_headers={**foreign, **more})
        assert caught.value.response.status_code == 403


def test_a_client_that_speaks_another_protocol_gets_an_error(server: ApiServer) -> None:
    _, token = server.token("watch")
    with pytest.raises(InvalidStatus) as caught:
        client(server, token, "foxglove.websocket.v9")
    assert caught.value.response.status_code == 400
    assert caught.value.response.body is not None
    assert b"foxglove.sdk.v1" in caught.value.response.body


def test_a_removed_token_closes_the_socket(server: ApiServer) -> None:
    program, token = server.token("watch")
    with client(server, token) as line:
        operations(line, "advertise")
        server.begin_to_remove(program)
        assert disconnected(line) == CLOSE_NOT_LET_IN


# ---- hostile clients


def hostile(kind: str) -> list[str | bytes]:
    """Return the messages of a hostile client."""
    deep = '{"op":"subscribe","subscriptions":' + "[" * 20_000 + "]" * 20_000 + "}"
    many = [{"id": number, "channelId": number + 900} for number in range(1500)]
    return {
        "garbage": [secrets.token_bytes(200) for _ in range(300)],
        "unknown ids": [json.dumps({"op": "subscribe", "subscriptions": many})] * 50,
        "deep JSON": [deep] * 50,
        "huge JSON": ['{"op":"subscribe","x":"' + "x" * 200_000 + '"}'],
        "calls without rights": [call_frame(number, 1, "json", b"{}") for number in range(150)],
        "flood": ['{"op":"unsubscribe","subscriptionIds":[]}'] * 2000,
    }[kind]


@pytest.mark.parametrize(
    "kind",
    ["garbage", "unknown ids", "deep JSON", "huge JSON", "calls without rights", "flood"],
)
@pytest.mark.cases(6)
def test_a_hostile_client_is_disconnected_and_others_notice_nothing(
    server: ApiServer, kind: str
) -> None:
    _, token = server.token("watch")
    seen: list[MessageData] = []
    with client(server, token) as watcher:
        _subscribe(watcher, "/cart/battery")
        ended = threading.Event()

        def watch() -> None:
            while not ended.is_set():
                message = watcher.recv(SOON_S)
                if isinstance(message, bytes):
                    read = FrameReader().read(message)
                    assert isinstance(read, MessageData)
                    seen.append(read)

        thread = threading.Thread(target=watch)
        thread.start()
        try:
            before = _resident(server)
            for _ in range(5):
                with client(server, token) as line:
                    with suppress(ConnectionClosed):
                        for message in hostile(kind):
                            line.send(message)
                    assert disconnected(line) in CODES
            count = len(seen)
            until_s = time.monotonic() + SOON_S
            while len(seen) < count + 3 and time.monotonic() < until_s:
                time.sleep(0.05)
            assert len(seen) >= count + 3, "the watcher was disconnected"
            assert _resident(server) - before < 32 * 1024 * 1024
        finally:
            ended.set()
            thread.join(SOON_S)


def _subscribe(line: ClientConnection, topic: str) -> None:
    while True:
        channels = operations(line, "advertise")["channels"]
        found = [one["id"] for one in channels if one["topic"] == topic]
        if found:
            wanted = [{"id": 1, "channelId": found[0]}]
            line.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            return


def _resident(server: ApiServer) -> int:
    """Return the resident memory of the server in bytes; 0 where the system does not tell."""
    place = Path(f"/proc/{server.process.pid}/statm")
    return int(place.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if place.exists() else 0


# ---- a slow client

FAST = """\
urc: 1
kind: robot
name: fast
title: Fast
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 7003, framing: { type: delimiter, tx: LF, rx: LF } }
signals: { number: { type: integer }, filler: { type: string } }
messages: { line: { regex: '^(?P<number>\\d+) (?P<filler>x+)$' } }
simulator:
  wire: [{ every: 5ms, send: "{{ (now * 1000) | int }} FILLER" }]
""".replace("FILLER", "x" * 4000)


def test_a_slow_client_costs_others_nothing_and_learns_what_it_missed(
    urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """The slow client reads nothing for some seconds, while 800 kB a second arrive for it."""
    server = started(urc_process, tmp_path, robots={"fast": FAST})
    key = key_of(server)
    place = urlsplit(server.address)
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    small.connect((place.hostname, place.port))
    with client(server, key, sock=small, max_queue=1) as slow, client(server, key) as quick:
        _subscribe(slow, "/fast/filler")
        _subscribe(quick, "/fast/number")
        before = _resident(server)
        gaps, last_s, end_s = [], time.monotonic(), time.monotonic() + SLOW_S
        while time.monotonic() < end_s:
            if isinstance(quick.recv(SOON_S), bytes):
                now_s = time.monotonic()
                gaps.append(now_s - last_s)
                last_s = now_s
        assert len(gaps) > 100 * SLOW_S / 2
        assert max(gaps[5:]) < 1.0
        assert _resident(server) - before < 16 * 1024 * 1024
        status = operations(slow, "status")
        assert status["id"] == "dropped"
        assert int(status["message"].split()[0]) > 100
        # What is sent now is new: old readings were dropped instead of queued.
        for _ in range(60):
            message = slow.recv(SOON_S)
            if isinstance(message, bytes):
                read = FrameReader().read(message)
                assert isinstance(read, MessageData)
        assert time.time() - read.time_ns / 1e9 < SLOW_S / 2
