"""`urc simulate` of the robots that ship, and programs of others that talk to them."""

import asyncio
import json
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.e2e.processes import ROOT, UrcProcess

__all__ = ["CLIENTS", "WAIT_S", "ask", "emulate", "told"]

CLIENTS = Path(__file__).parent / "clients"
WAIT_S = 60.0
"""How long a whole dialogue may take on a machine that is busy."""

Start = Callable[..., UrcProcess]


async def emulate(start: Start, robot: str, ports: Sequence[str] = ("port",)) -> dict[str, int]:
    """Start `urc simulate` of a robot that ships, on free ports.

    Args:
        start: the fixture `urc_process`.
        robot: its name.
        ports: settings that are ports it listens on.

    Returns:
        Transport → its port.
    """
    chosen = [word for name in ports for word in ("--set", f"{name}=0")]
    process = start("simulate", f"robots/{robot}.yaml", *chosen)
    for _ in ports:
        await process.wait_for_async(r"^listening \S+ .*?:\d+")
    return listening(process.output, len(ports)) or await _later(process, len(ports))


def listening(lines: Sequence[str], count: int) -> dict[str, int]:
    """Return transport → port of the lines that tell it, once there are so many."""
    found = (re.match(r"listening (\S+) .*?:(\d+)", line) for line in lines)
    ports = {match[1]: int(match[2]) for match in found if match}
    return ports if len(ports) >= count else {}


async def _later(process: UrcProcess, count: int) -> dict[str, int]:
    async with asyncio.timeout(WAIT_S):
        while not (ports := listening(process.output, count)):
            assert process.is_running, process.errors
            await asyncio.sleep(0.02)
    return ports


async def told(*command: str, environment: Mapping[str, str] | None = None) -> str:
    """Run a program to its end; return what it said, and fail with what it complained of."""
    process = await asyncio.create_subprocess_exec(
        *command,
        cwd=ROOT,
        env=os.environ | dict(environment or {}),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        async with asyncio.timeout(WAIT_S):
            said, complaint = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode == 0, complaint.decode("utf-8", "replace")[-3000:]
    return said.decode("utf-8", "replace")


async def ask(client: str, *arguments: str, before: Sequence[str] = ()) -> dict[str, Any]:
    """Run a dialogue of `clients`; return what it prints as JSON.

    Args:
        client: its file.
        arguments: of the script.
        before: a program that runs it, as on another network.
    """
    said = await told(*before, sys.executable, str(CLIENTS / client), *arguments)
    found: dict[str, Any] = json.loads(said.splitlines()[-1])
    return found
