"""A session over a real socket: the good-bye that a driver declares, and secrets in the traffic."""

import asyncio
from contextlib import suppress
from pathlib import Path

import pytest

from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

pytestmark = pytest.mark.anyio

POLITE = """\
urc: 1
kind: robot
name: polite
settings:
  port: { type: port }
  password: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect:
      - { send: "login {{ settings.password }}", redact: true }
    on_close:
      - { send: bye }
signals:
  note: { type: string }
messages:
  note: { regex: '^note (?P<note>.*)$' }
"""


async def test_session_says_goodbye_and_shows_no_secret(tmp_path: Path) -> None:
    """What `on_close` declares is the last thing the robot hears; no log has the password."""
    heard: list[bytes] = []
    ended = asyncio.Event()

    async def robot(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            while line := await reader.readline():
                heard.append(line)
                writer.write(b"note hello\n")
        writer.close()
        ended.set()

    file = tmp_path / "polite.yaml"
    file.write_text(POLITE, encoding="utf-8")
    server = await asyncio.start_server(robot, "127.0.0.1", 0)
    catalog = built_in_catalog()
    settings = {"port": server.sockets[0].getsockname()[1], "password": "s3cret"}
    async with server:
        session = Session(load_profile(file, catalog), settings, catalog.transports)
        async with session:
            session.hub.traffic_watchers += 1
            with session.hub.subscribe() as subscription:
                while session.hub.latest("note") is None:
                    await asyncio.wait_for(subscription.changed(), 10)
                    subscription.changes()
        await asyncio.wait_for(ended.wait(), 10)
    assert heard == [b"login s3cret\n", b"bye\n"]
    sent = b"".join(item.data for item in session.hub.traffic if item.direction == "sent")
    assert b"s3cret" not in sent
    assert sent.endswith(b"bye\n")
