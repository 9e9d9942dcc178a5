"""Loses packets on loopback: the only honest way to make a half-open line. Needs root."""

import asyncio

__all__ = ["Loss"]


class Loss:
    """Rules that lose every packet from and to one port of this machine, until `end`."""

    def __init__(self, port: int, protocol: str = "tcp") -> None:
        """Choose the port; `begin` loses packets."""
        self._rules = [
            ["INPUT", "-i", "lo", "-p", protocol, f"--{side}", str(port), "-j", "DROP"]
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
