"""Two machines on a network of their own, for programs whose ports cannot be chosen.

Both ends of a Tello bind UDP 8889, which one address cannot have twice. Needs root.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

__all__ = ["Lan", "lan"]

_LIMIT_S = 10.0


class Lan(NamedTuple):
    """What runs a program on either machine."""

    robot: tuple[str, ...]
    robot_address: str
    client: tuple[str, ...]


@asynccontextmanager
async def lan(
    name: str, robot: str = "192.168.10.1", client: str = "192.168.10.2"
) -> AsyncIterator[Lan]:
    """Join two network namespaces by a cable; both are gone afterwards.

    Args:
        name: of this network on this machine, at most 10 characters.
        robot: address of the robot.
        client: address of whoever talks to it.
    """
    here, there = f"{name}-r", f"{name}-c"
    try:
        await _ip("netns", "add", here)
        await _ip("netns", "add", there)
        await _ip(
            "link", "add", "eth0", "netns", here, "type", "veth", "peer", "eth0", "netns", there
        )
        for space, address in ((here, robot), (there, client)):
            await _ip("-n", space, "address", "add", f"{address}/24", "dev", "eth0")
            for device in ("lo", "eth0"):
                await _ip("-n", space, "link", "set", device, "up")
        run = ("ip", "netns", "exec")
        yield Lan((*run, here), robot, (*run, there))
    finally:
        for space in (here, there):
            await _ip("netns", "del", space, is_needed=False)


async def _ip(*words: str, is_needed: bool = True) -> None:
    process = await asyncio.create_subprocess_exec("ip", *words, stderr=asyncio.subprocess.PIPE)
    async with asyncio.timeout(_LIMIT_S):
        _, complaint = await process.communicate()
    assert process.returncode == 0 or not is_needed, complaint.decode()
