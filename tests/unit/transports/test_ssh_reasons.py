"""Why a server lets nobody in, told by servers that close right behind their last word."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from urc.transports.base import ConnectFailed, TransportSetup
from urc.transports.ssh import read_target
from urc.transports.ssh_dial import dial

pytestmark = pytest.mark.anyio

VERSION = b"SSH-2.0-OpenSSH_5.5\r\n"
KEXINIT, DISCONNECT = 20, 1
PINNED = "SHA256:" + "a" * 43
OLD = (
    b"diffie-hellman-group14-sha1", b"ssh-rsa", b"aes128-cbc", b"aes128-cbc",
    b"hmac-sha1", b"hmac-sha1", b"none", b"none", b"", b"",
)  # fmt: skip
"""What a server of 2010 offers, in the order of RFC 4253, 7.1."""
NEW = (
    b"curve25519-sha256", b"ssh-ed25519", b"aes128-ctr", b"aes128-ctr",
    b"hmac-sha2-256", b"hmac-sha2-256", b"none", b"none", b"", b"",
)  # fmt: skip


def string(text: bytes) -> bytes:
    return len(text).to_bytes(4, "big") + text


def packet(kind: int, body: bytes) -> bytes:
    """Return a packet as it is before anything is agreed (RFC 4253, 6)."""
    payload = bytes([kind]) + body
    padding = 8 - (len(payload) + 5) % 8 + 4
    return string(bytes([padding]) + payload + bytes(padding))


def offer(algorithms: Sequence[bytes]) -> bytes:
    return packet(KEXINIT, bytes(16) + b"".join(map(string, algorithms)) + bytes(5))


def good_bye(text: bytes) -> bytes:
    return packet(DISCONNECT, (12).to_bytes(4, "big") + string(text) + string(b""))


class Line(asyncio.Transport):
    """What we say goes nowhere."""

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...

    def get_write_buffer_size(self) -> int:
        return 0

    def write(self, data: object) -> None: ...

    def close(self) -> None: ...

    def abort(self) -> None: ...


class Curt:
    """Carries a connection to a server that says its words, and is gone in the same moment."""

    def __init__(self, words: bytes, fault: OSError | None = None) -> None:
        self._words, self._fault = words, fault

    async def create_connection(
        self, factory: Callable[[], Any], host: str, port: int, encoding: None
    ) -> tuple[Line, Any]:
        session = factory()
        session.connection_made(Line())
        asyncio.get_running_loop().call_soon(self._speak, session)
        return Line(), session

    def _speak(self, session: Any) -> None:
        session.data_received(self._words, None)
        if self._fault is None:
            session.eof_received()
        session.connection_lost(self._fault)


async def refusal(server: Curt) -> str:
    given = {"host": "10.0.0.7", "username": "robot", "password": "x", "host_key": PINNED}
    target = read_target(TransportSetup("gauge", given))
    with pytest.raises(ConnectFailed) as told:
        await dial(target, server, 5.0)  # type: ignore[arg-type] # all of it that is used
    return str(told.value)


RESET = ConnectionResetError(104, "Connection reset by peer")


@pytest.mark.parametrize("fault", [None, RESET])
async def test_server_without_a_common_algorithm_is_told_so(fault: OSError | None) -> None:
    """Though it has closed the connection before we have read what it offers."""
    said = await refusal(Curt(VERSION + offer(OLD), fault))
    assert "offers no algorithm that URC accepts; 'legacy: true' permits old algorithms" in said
    assert "received aes128-cbc" in said


async def test_good_bye_behind_an_offer_is_not_lost() -> None:
    """It waits in the same bytes, while the offer is looked at."""
    said = await refusal(Curt(VERSION + offer(NEW) + good_bye(b"Too many users")))
    assert said.startswith("10.0.0.7:22 refused the connection (too many users")


async def test_server_that_says_nothing_more_has_closed_the_line() -> None:
    """Then there is no other reason."""
    said = await refusal(Curt(VERSION))
    assert said == "10.0.0.7:22 closed the connection before the login was complete"
