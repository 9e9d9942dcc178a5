"""The least that a program can do with a robot's messages on each line.

``python -m bench.peers.ros_reader LINE PORT TOPIC…`` subscribes to the topics of
`bench.peers.ros_streams`, decodes the fields that the page shows, and keeps only the newest value
of each. There is no engine and no page. It uses the same libraries and the same event loop as URC,
and prints ``ready`` after the first message of every topic. The program ends with its standard
input. It imports nothing from URC.
"""

import asyncio
import base64
import json
import struct
import sys
from array import array
from collections.abc import Callable
from typing import Any

import msgspec
import uvloop
import zenoh
from websockets.asyncio.client import connect

BODY = 4
"""Length of the head of each CDR message, in bytes."""
FIRST = BODY + 8
"""Position of the header's first text, after the time stamp."""
Values = tuple[Any, ...]
decode_json = msgspec.json.Decoder().decode


Reader = Callable[[bytes], Values]


def aligned(at: int, size: int) -> int:
    """Return the next position of a value with the given size."""
    return at + (BODY - at) % size


def after_text(data: bytes, at: int) -> int:
    """Return the position after a text."""
    at = aligned(at, 4)
    return at + 4 + int(struct.unpack_from("<I", data, at)[0])


def odometry(data: bytes) -> Values:
    """Return position and orientation."""
    return struct.unpack_from("<7d", data, aligned(after_text(data, after_text(data, FIRST)), 8))


def imu(data: bytes) -> Values:
    """Return the orientation."""
    return struct.unpack_from("<4d", data, aligned(after_text(data, FIRST), 8))


def scan(data: bytes) -> Values:
    """Return the first angle, the step and the ranges."""
    at = aligned(after_text(data, FIRST), 4)
    first, _, step, *_, count = struct.unpack_from("<7fI", data, at)
    return first, step, array("f", data[at + 32 : at + 32 + 4 * count]).tolist()


def picture(data: bytes) -> Values:
    """Return the image."""
    at = aligned(after_text(data, after_text(data, FIRST)), 4)
    return (data[at + 4 :],)


def plain_odometry(told: dict[str, Any]) -> Values:
    """Return position and orientation."""
    at, turn = told["pose"]["pose"]["position"], told["pose"]["pose"]["orientation"]
    return at["x"], at["y"], at["z"], turn["x"], turn["y"], turn["z"], turn["w"]


def plain_imu(told: dict[str, Any]) -> Values:
    """Return the orientation."""
    turn = told["orientation"]
    return turn["x"], turn["y"], turn["z"], turn["w"]


READ = {"odom": odometry, "imu": imu, "scan": scan, "front": picture, "rear": picture}
PLAIN: dict[str, Callable[[dict[str, Any]], Values]] = {
    "odom": plain_odometry,
    "imu": plain_imu,
    "scan": lambda told: (told["angle_min"], told["angle_increment"], told["ranges"]),
    "front": lambda told: (base64.b64decode(told["data"]),),
    "rear": lambda told: (base64.b64decode(told["data"]),),
}


class Newest:
    """The newest values of each topic."""

    def __init__(self, topics: list[str]) -> None:
        self._topics = topics
        self._values: dict[str, Values] = {}

    def take(self, topic: str, values: Values) -> None:
        """Keep the values; after the first message of every topic, report it."""
        is_first = topic not in self._values
        self._values[topic] = values
        if is_first and len(self._values) == len(self._topics):
            print("ready", flush=True)


async def over_rosbridge(port: int, topics: list[str]) -> None:
    """Receive the messages as JSON."""
    newest = Newest(topics)
    async with connect(f"ws://127.0.0.1:{port}", compression=None, max_size=None) as line:
        for topic in topics:
            await line.send(json.dumps({"op": "subscribe", "topic": f"/{topic}"}))
        async for frame in line:
            said = decode_json(frame)
            if said["op"] == "publish":
                topic = said["topic"][1:]
                newest.take(topic, PLAIN[topic](said["msg"]))


async def over_foxglove(port: int, topics: list[str]) -> None:
    """Receive the messages as CDR over a Foxglove server."""
    newest, numbers = Newest(topics), {one: number for number, one in enumerate(topics)}
    async with connect(
        f"ws://127.0.0.1:{port}",
        subprotocols=["foxglove.sdk.v1"],  # type: ignore[list-item] # a NewType of text
        compression=None,
        max_size=None,
    ) as line:
        async for frame in line:
            if isinstance(frame, bytes):
                if frame[0] == 1:
                    topic = topics[int.from_bytes(frame[1:5], "little")]
                    newest.take(topic, READ[topic](frame[13:]))
                continue
            said = decode_json(frame)
            found = [
                {"id": numbers[one["topic"][1:]], "channelId": one["id"]}
                for one in said.get("channels", ())
                if one["topic"][1:] in numbers
            ]
            if found:
                await asyncio.sleep(0.2)  # the server announces a channel before it accepts
                await line.send(json.dumps({"op": "subscribe", "subscriptions": found}))


async def over_zenoh(port: int, topics: list[str]) -> None:
    """Receive the messages as CDR over a Zenoh router, with a connection of the library."""
    settings = {
        "mode": "client",
        "connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},  # a robot is another computer
    }
    newest = Newest(topics)
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))

    def taking(topic: str) -> Callable[[Any], None]:
        return lambda sample: newest.take(topic, READ[topic](sample.payload.to_bytes()))

    kept = [
        session.declare_subscriber(
            f"0/{topic}/**", zenoh.handlers.Callback(taking(topic), indirect=False)
        )
        for topic in topics
    ]
    await asyncio.Event().wait()
    del kept


LINES = {"rosbridge": over_rosbridge, "foxglove": over_foxglove, "zenoh": over_zenoh}


async def main(line: str, port: int, topics: list[str]) -> None:
    """Receive until the standard input ends."""
    task = asyncio.create_task(LINES[line](port, topics))
    ended = asyncio.create_task(asyncio.to_thread(sys.stdin.read))
    await asyncio.wait([task, ended], return_when=asyncio.FIRST_COMPLETED)
    if task.done():
        task.result()
    task.cancel()


if __name__ == "__main__":
    uvloop.run(main(sys.argv[1], int(sys.argv[2]), sys.argv[3:]))
