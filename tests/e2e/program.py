"""A program that drives the cart until it is killed: ``python program.py OPENING PLACE``.

OPENING is ``here`` (PLACE: the profile), ``server`` or ``sync`` (PLACE: the server's address).
"""

import asyncio
import sys

import urc
import urc.client
from urc.client import sync
from urc.testing.entry import KEY

SECONDS = 60.0


async def drive(opening: str, place: str) -> None:
    """Drive for a minute, in an event loop."""
    context = urc.connect(place) if opening == "here" else urc.client.open(place, token=KEY)
    async with context as robot, robot.drive() as stick:
        print("driving", flush=True)  # noqa: T201 - the test reads it
        await stick.hold(SECONDS, speed=0.5)


def drive_in_sync(place: str) -> None:
    """Drive for a minute, without ``async``."""
    with sync.open(place, token=KEY) as robot, robot.drive() as stick:
        print("driving", flush=True)  # noqa: T201 - the test reads it
        stick.hold(SECONDS, speed=0.5)


if __name__ == "__main__":
    if sys.argv[1] == "sync":
        drive_in_sync(sys.argv[2])
    else:
        asyncio.run(drive(sys.argv[1], sys.argv[2]))
