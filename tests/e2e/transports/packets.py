"""Loses packets on loopback: the only honest way to make a half-open line. Needs root.

A run that is killed cannot take its rules away, and whoever is given such a port by the system
later waits there for good. So each rule says whose it is, and a new run takes away those of the
dead.
"""

import asyncio
import os
import re
import subprocess

__all__ = ["Loss", "sweep"]

_MARK = "urc-test"
_OURS = re.compile(rf'^-A (INPUT .*--comment "?{_MARK}:(\d+)"? .*)$', re.MULTILINE)


class Loss:
    """Rules that lose every packet from and to one port of this machine, until `end`."""

    def __init__(self, port: int, protocol: str = "tcp") -> None:
        """Choose the port; `begin` loses packets."""
        whose = ["-m", "comment", "--comment", f"{_MARK}:{os.getpid()}"]
        self._rules = [
            ["INPUT", "-i", "lo", "-p", protocol, f"--{side}", str(port), *whose, "-j", "DROP"]
            for side in ("dport", "sport")
        ]
        self._begun: list[list[str]] = []

    async def begin(self) -> None:
        """Lose packets from now on."""
        for rule in self._rules:
            await _iptables("-I", *rule)
            self._begun.append(rule)

    async def end(self) -> None:
        """Let them pass again."""
        while self._begun:
            await _iptables("-D", *self._begun.pop())


async def _iptables(*arguments: str) -> None:
    process = await asyncio.create_subprocess_exec(
        "iptables",
        "-w",
        "5",
        *arguments,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    said, _ = await process.communicate()
    assert process.returncode == 0, said.decode()


def sweep() -> None:
    """Take away the rules of runs that are no more; whoever may not look has made none."""
    listed = _run("-S", "INPUT")
    for rule, pid in _OURS.findall(listed):
        if not os.path.exists(f"/proc/{pid}"):
            _run("-D", *rule.replace('"', "").split())


def _run(*arguments: str) -> str:
    command = ["iptables", "-w", "5", *arguments]
    try:
        return subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=10
        ).stdout
    except (OSError, subprocess.TimeoutExpired):
        return ""
