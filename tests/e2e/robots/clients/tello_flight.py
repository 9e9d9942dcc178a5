"""A flight with tello-asyncio, as its examples show it. Prints one line of JSON at the end.

The library binds the ports of the SDK, so it runs on a network of its own; see `lan.py`.
"""

import asyncio
import contextlib
import io
import json
import sys
from collections.abc import Callable
from typing import Any

import av
from tello_asyncio import Tello

WAIT_S = 45.0


async def main() -> dict[str, Any]:
    states: list[Any] = []
    frames: list[bytes] = []
    drone = Tello(on_state=lambda _, state: states.append(state))

    async def until(is_true: Callable[[Any], bool]) -> None:
        async with asyncio.timeout(WAIT_S):
            while not (states and is_true(states[-1])):  # noqa: ASYNC110 - it comes by callback
                await asyncio.sleep(0.05)

    await drone.connect()
    found: dict[str, Any] = {"battery": await drone.query_battery()}
    await until(lambda state: state.height == 0)
    await drone.start_video(lambda _, frame: frames.append(frame))
    await drone.takeoff()
    await until(lambda state: state.height > 20)
    height = states[-1].height
    await drone.move_up(50)
    await until(lambda state: state.height > height + 20)
    await drone.turn_clockwise(90)
    await until(lambda state: abs(state.yaw) > 45)
    await drone.remote_control(0, 60, 0, 0)
    await until(lambda state: state.velocity.x != 0 or state.velocity.y != 0)
    await drone.remote_control(0, 0, 0, 0)
    await until(lambda state: state.velocity.x == 0 and state.velocity.y == 0)
    await drone.land()
    await until(lambda state: state.height == 0)
    await drone.stop_video()
    found["states"] = len(states)
    found["video"] = sizes_of(frames)
    await drone.disconnect()
    return found


def sizes_of(frames: list[bytes]) -> list[tuple[int, int]]:
    """Decode what the library takes for images, in their order; return the size of each."""
    decoder = av.CodecContext.create("h264", "r")
    packets = [packet for frame in (*frames, b"") for packet in decoder.parse(frame)]
    images = [image for packet in packets for image in decoder.decode(packet)]
    return [(image.width, image.height) for image in (*images, *decoder.decode(None))]


if __name__ == "__main__":
    with contextlib.redirect_stdout(io.StringIO()):  # the library prints all that it says
        result = asyncio.run(main())
    sys.stdout.write(json.dumps(result) + "\n")
