"""What the tests against OpenSSH's server share: a folder for it, lines to it, what they say."""

import asyncio
import tempfile
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.transports.sshd import PASSWORD, USER, Sshd
from urc.transports.base import ConnectFailed, PeerClosed, TransportSetup
from urc.transports.ssh import SshTransport, from_setup

__all__ = ["OPEN_S", "end_of", "hears", "line_to", "public_folder", "refusal"]

OPEN_S = 20.0


def public_folder(factory: pytest.TempPathFactory) -> Path:
    """Return a folder that other users may enter: the server looks for keys as the user."""
    folder = factory.mktemp("sshd")
    top = Path(tempfile.gettempdir())
    for one in (folder, *folder.parents):
        if one.is_relative_to(top) and one != top:
            one.chmod(0o755)
    return folder


def line_to(sshd: Sshd, **options: Any) -> SshTransport:
    """Return a line that logs in by password and knows the key, unless `options` say otherwise."""
    default = {
        "host": "127.0.0.1", "port": sshd.port, "username": USER, "password": PASSWORD,
        "host_key": sshd.fingerprint,
    }  # fmt: skip
    given = {name: value for name, value in (default | options).items() if value is not None}
    return from_setup(TransportSetup("gauge", given))


async def refusal(line: SshTransport) -> str:
    """Return what opening says."""
    with pytest.raises(ConnectFailed) as told:
        await line.open(OPEN_S)
    return str(told.value)


async def hears(line: SshTransport, expected: bytes) -> bytes:
    """Return what came, up to and with `expected`."""
    got = b""
    async with asyncio.timeout(OPEN_S):
        while expected not in got:
            got += await line.receive()
    return got


async def end_of(line: SshTransport, within_s: float = OPEN_S) -> str:
    """Return why the line ended."""
    async with asyncio.timeout(within_s):
        try:
            while True:
                await line.receive()
        except PeerClosed as told:
            return str(told)
