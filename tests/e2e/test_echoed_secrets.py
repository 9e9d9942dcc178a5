"""A robot that repeats its password: whoever looks, wherever, is not shown it."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import connect

from tests.e2e.command_line import page, run
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess

pytestmark = pytest.mark.anyio
Start = Callable[..., UrcProcess]

WORD = "hunter2-and-3"
ECHO = """\
urc: 1
kind: robot
name: parrot
settings:
  password: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  heard: { type: string }
messages:
  heard: { regex: '^heard (?P<heard>.*)$' }
commands:
  login: { send: "login {{ settings.password }}", reply: { regex: '^ok (?P<heard>.*)$' } }
  shout: { send: shout, reply: { equals: ok, errors: ['^NO'] } }
"""


@pytest.fixture
async def parrot(tmp_path: Path) -> AsyncIterator[str]:
    """The file of a robot that says it in all ways that it has."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async def chatter() -> None:
            while True:
                for said in (f"heard {WORD}", f"what is {WORD}", WORD.encode().hex(" ")):
                    writer.write(f"{said}\n".encode())
                    await asyncio.sleep(0.05)

        talking = asyncio.create_task(chatter())
        # A client that ends with unread data resets the connection.
        with suppress(ConnectionResetError):
            while line := await reader.readline():
                is_login = line.startswith(b"login ")
                writer.write((f"ok {WORD}\n" if is_login else f"NO {WORD}\n").encode())
        talking.cancel()
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        file = tmp_path / "parrot.yaml"
        file.write_text(ECHO.replace("PORT", str(server.sockets[0].getsockname()[1])), "utf-8")
        yield str(file)


def is_hidden(text: str) -> bool:
    """Return whether something was taken out of a text, and nothing is left of it."""
    ways = (WORD, WORD.encode().hex(), WORD.encode().hex(" "), WORD[:6])
    return "‹secret›" in text and not any(way in text for way in ways)


@pytest.mark.parametrize("words", [(), ("--wire",)], ids=["values", "wire"])
async def test_watch_prints_no_secret(words: tuple[str, ...], parrot: str) -> None:
    """Neither a value, nor the traffic in hex and text, nor a line of the log."""
    args = ("watch", parrot, "--for", "1s", *words)
    done = await asyncio.to_thread(run, *args, URC_SET_PASSWORD=WORD)
    assert done.returncode == 0
    assert is_hidden(done.stdout)
    assert is_hidden(done.stderr)


async def test_send_prints_no_secret(parrot: str, tmp_path: Path) -> None:
    """Neither a reply nor a refusal."""
    said = {"URC_SET_PASSWORD": WORD, "URC_DATA_DIR": str(tmp_path / "data")}
    done = await asyncio.to_thread(run, "send", parrot, "login", **said)
    assert json.loads(done.stdout)["values"] == {"heard": "‹secret›"}
    done = await asyncio.to_thread(run, "send", parrot, "shout", **said)
    assert done.returncode == 1
    assert is_hidden(done.stderr)


async def test_no_page_shows_a_secret(parrot: str, tmp_path: Path, urc_process: Start) -> None:
    """Neither the log and the values of the robot's page, nor its card."""
    server = urc_process(
        "serve", parrot, "--port", "0", URC_SET_PASSWORD=WORD, URC_DATA_DIR=str(tmp_path / "data")
    )
    url = (await server.wait_for_async(r"dashboard (http://\S+)"))[1]
    address = urlsplit(url).netloc
    said: list[str] = []
    line = connect(
        f"ws://{address}/ws?robot=parrot",
        origin=f"http://{address}",
        additional_headers=headers_for(url),
    )
    async with line as screen, asyncio.timeout(30):
        async for text in screen:
            said.append(str(text))
            if "no-match" in str(text) and any("heard" in one for one in said):
                break
        card = await asyncio.to_thread(page, f"http://{address}/robots/parrot/card")
    assert is_hidden(" ".join(said))
    assert is_hidden(card)
