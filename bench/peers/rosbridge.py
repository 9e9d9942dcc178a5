"""A rosbridge server with a robot, and two pages: ``python rosbridge.py`` prints its port.

Each subscriber to a topic gets messages at the topic's rate. The pages are ``roslib.html``, with
the modules of ``node_modules``, and ``picture.html``.
"""

import asyncio
import base64
import contextlib
import http
import io
import json
import math
import mimetypes
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

HERE = Path(__file__).resolve().parent
MODULES = HERE.parents[1] / "node_modules"
PAGES = {"/roslib": HERE / "roslib.html", "/picture": HERE / "picture.html"}
PICTURE = (640, 480)
GRAIN, QUALITY = 11, 75
"""Noise amplitude and JPEG quality, chosen so that each image has about 47 kB."""


def header() -> dict[str, object]:
    """Return a ROS message header with the time."""
    now_s = time.time()
    stamp = {"secs": int(now_s), "nsecs": int(now_s % 1 * 1e9)}
    return {"seq": 0, "stamp": stamp, "frame_id": "odom"}


def quaternion(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    """Return the quaternion of three angles."""
    sines = [math.sin(angle / 2) for angle in (roll, pitch, yaw)]
    cosines = [math.cos(angle / 2) for angle in (roll, pitch, yaw)]
    (sr, sp, sy), (cr, cp, cy) = sines, cosines
    return {
        "x": sr * cp * cy - cr * sp * sy,
        "y": cr * sp * cy + sr * cp * sy,
        "z": cr * cp * sy - sr * sp * cy,
        "w": cr * cp * cy + sr * sp * sy,
    }


def odometry(at_s: float) -> dict[str, object]:
    """Return an odometry message on a circle with a radius of three metres."""
    turn = at_s / 6
    position = {"x": 3 * math.cos(turn), "y": 3 * math.sin(turn), "z": 0.0}
    pose = {"position": position, "orientation": quaternion(0, 0, turn + math.pi / 2)}
    still = {"x": 0.0, "y": 0.0, "z": 0.0}
    {"linear": still | {"x": 0.5}, "angular": still}
    return {
        "header": header(),
        "child_frame_id": "base",
        "pose": {"pose": pose, "covariance": [0.0] * 36},
        "twist": {
            "twist": {"linear": still | {"x": 0.5}, "angular": still},
            "covariance": [0.0] * 36,
        },
    }


def imu(at_s: float) -> dict[str, object]:
    """Return an IMU message whose orientation sways."""
    turning = {"x": 0.1, "y": 0.2, "z": 0.3}
    return {
        "header": header(),
        "orientation": quaternion(0.3 * math.sin(at_s), 0.2 * math.cos(at_s * 1.3), 0),
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": turning,
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": turning,
        "linear_acceleration_covariance": [0.0] * 9,
    }


def battery(at_s: float) -> dict[str, object]:
    """Return a battery message with a falling voltage."""
    return {"header": header(), "voltage": 12 - at_s % 40 / 20, "percentage": 0.8}


def pictures() -> list[str]:
    """Return fifteen different images, each as base64 text."""
    chance = random.Random(1)  # noqa: S311 - noise, the same in each run
    made = []
    for number in range(15):
        noise = bytes(128 + chance.randrange(-GRAIN, GRAIN) for _ in range(PICTURE[0] * PICTURE[1]))
        image = Image.frombytes("L", PICTURE, noise).convert("RGB")
        ImageDraw.Draw(image).ellipse((number * 36, 180, number * 36 + 120, 300), fill="orange")
        file = io.BytesIO()
        image.save(file, "JPEG", quality=QUALITY)
        made.append(base64.b64encode(file.getvalue()).decode())
    return made


PICTURES = pictures()
CAMERA_HZ = 15


def camera(at_s: float) -> dict[str, object]:
    """Return an image message with the next of the fifteen images."""
    data = PICTURES[int(at_s * CAMERA_HZ) % len(PICTURES)]
    return {"header": header(), "format": "jpeg", "data": data}


TOPICS: dict[str, tuple[Callable[[float], dict[str, object]], int]] = {
    "/odom": (odometry, 50),
    "/imu": (imu, 100),
    "/camera/compressed": (camera, CAMERA_HZ),
    "/battery_state": (battery, 10),
}
"""For each topic, the function that builds a message for a given time, and the message rate."""


async def publish(line: ServerConnection, topic: str) -> None:
    """Send a topic's messages at its rate."""
    make, rate_hz = TOPICS[topic]
    began_s = time.monotonic()
    number = 0
    with contextlib.suppress(ConnectionClosed):
        while True:
            message = {"op": "publish", "topic": topic, "msg": make(number / rate_hz)}
            await line.send(json.dumps(message))
            number += 1
            await asyncio.sleep(max(0.0, began_s + number / rate_hz - time.monotonic()))


async def meet(line: ServerConnection) -> None:
    """Serve a client; messages published by the client are dropped."""
    tasks: dict[str, asyncio.Task[None]] = {}
    try:
        async for text in line:
            asked: dict[str, Any] = json.loads(text)
            topic = asked.get("topic", "")
            if asked["op"] == "subscribe" and topic in TOPICS and topic not in tasks:
                tasks[topic] = asyncio.create_task(publish(line, topic))
            elif asked["op"] == "unsubscribe" and topic in tasks:
                tasks.pop(topic).cancel()
    finally:
        for task in tasks.values():
            task.cancel()


def page(_: ServerConnection, request: Request) -> Response | None:
    """Answer a request for a page or a module; return None for a WebSocket handshake."""
    if "Upgrade" in request.headers:
        return None
    path = request.path.partition("?")[0]
    file = PAGES.get(path) or (MODULES / path[1:]).resolve()
    if not file.is_file():
        return Response(http.HTTPStatus.NOT_FOUND, "Not Found", Headers(), b"")
    data = file.read_bytes()
    kind = mimetypes.guess_type(file.name)[0] or "text/javascript"
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(data))})
    return Response(http.HTTPStatus.OK, "OK", headers, data)


async def main() -> None:
    """Serve every client."""
    async with serve(meet, "127.0.0.1", 0, process_request=page, compression=None) as server:
        print("ready", next(iter(server.sockets)).getsockname()[1], flush=True)
        await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())
