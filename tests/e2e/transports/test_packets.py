"""Packets that are lost on purpose: by whom, and that nobody inherits it."""

import os
import subprocess
import sys

import pytest

from tests.e2e.transports.packets import Loss, sweep

pytestmark = [pytest.mark.anyio, pytest.mark.needs("iptables")]

DIES = """
import asyncio, os, signal
from tests.e2e.transports.packets import Loss
asyncio.run(Loss(9).begin())
os.kill(os.getpid(), signal.SIGKILL)
"""


def rules() -> str:
    """Return what is lost now."""
    listed = subprocess.run(["iptables", "-w", "5", "-S", "INPUT"], capture_output=True, check=True)
    return listed.stdout.decode()


def killed() -> int:
    """Let a run begin to lose packets, and kill it; return its number."""
    with subprocess.Popen([sys.executable, "-c", DIES]) as process:
        return process.pid


async def test_the_rules_of_a_run_that_was_killed_are_taken_away() -> None:
    """And those of one that lives are not."""
    mine = Loss(10)
    await mine.begin()
    try:
        dead = killed()
        assert f"urc-test:{dead}" in rules()
        sweep()
        assert f"urc-test:{dead}" not in rules()
        assert rules().count(f"urc-test:{os.getpid()}") == 2
    finally:
        await mine.end()
    assert f"urc-test:{os.getpid()}" not in rules()
