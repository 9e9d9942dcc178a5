"""Canaries of passphrase, token, sign-in, start key and pairing code: found nowhere but in use.

A person signs in by a real page, a program uses a token, and both drive around. Then pages, API,
logs, audit, recordings, backups, the process list and all files are searched for the secrets, in
plain and in common encodings.
"""

import asyncio
import base64
import json
import stat
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from urllib.parse import quote, urlsplit

import httpx2
import pytest
from playwright.async_api import Request as PageRequest
from websockets.asyncio.client import connect

from tests.e2e.command_line import run
from tests.e2e.conftest import PageMaker
from tests.e2e.keys import headers_for, without_key
from tests.e2e.processes import ROOT, UrcProcess

pytestmark = pytest.mark.anyio
Start = Callable[..., UrcProcess]

PASSPHRASE = "canary-Wh1te+tulip/over?water"  # noqa: S105
WRONG = "canary-Gr8y+heron/under?bridge"
PAGES = ("", "robots/tello/", "people", "account", "audit", "trust", "drivers", "widgets")
CALLS = ("robots", "robots/tello", "robots/tello/signals", "people", "audit", "audit/export")


def forms(secret: str) -> Iterable[bytes]:
    """Yield a secret as it may appear in files, logs and addresses."""
    data = secret.encode()
    yield data
    yield data.hex().encode()
    yield base64.b64encode(data).rstrip(b"=")
    yield quote(secret, safe="").encode()
    yield json.dumps(secret)[1:-1].encode()


def found_in(data: bytes, secrets: dict[str, str]) -> list[str]:
    """Return the names of the secrets in `data`."""
    return [name for name, one in secrets.items() if any(form in data for form in forms(one))]


def processes() -> bytes:
    """Return the command lines of all processes of this machine, as other users read them."""
    lines = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            lines.append(file.read_bytes())
        except OSError:
            continue  # the process has ended
    return b"\n".join(lines)


def said(command: str, *words: str, data: Path, text: str) -> None:
    """Run a command that reads a secret from its standard input."""
    subprocess.run(
        [sys.executable, "-m", "urc.cli.main", command, *words, "--data-dir", str(data)],
        cwd=ROOT,
        input=text,
        text=True,
        check=True,
        capture_output=True,
        timeout=60,
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the process list is read from /proc")
async def test_secrets_are_nowhere(urc_process: Start, new_page: PageMaker, tmp_path: Path) -> None:
    data, records = tmp_path / "data", tmp_path / "records"
    process = urc_process(
        "serve", "robots/tello.yaml", "--simulate", "--port", "0",
        "--data-dir", str(data), "--record", str(records),
    )  # fmt: skip
    address = (await process.wait_for_async(r"^dashboard (http://\S+)"))[1]
    added = run("people", "add", "Ann", "--role", "administer", "--data-dir", str(data))
    assert added.returncode == 0, added.stderr
    await asyncio.to_thread(said, "people", "passphrase", "Ann", data=data, text=f"{PASSPHRASE}\n")
    made = run("tokens", "add", "script", "--role", "drive", "--data-dir", str(data))
    token = made.stdout.strip().splitlines()[-1].split()[-1]
    pairing = run("devices", "pair", "--data-dir", str(data)).stdout
    code = pairing.partition("/pair#")[2].split()[0]
    secrets = {
        "passphrase": PASSPHRASE,
        "wrong passphrase": WRONG,
        "token": token,
        "pairing code": code,
        "start key": headers_for(address)["Authorization"].removeprefix("Bearer "),
    }
    assert all(len(one) > 15 for one in secrets.values()), secrets

    page = await new_page()
    new_page.allow(page, lambda text: "401" in text or "403" in text)
    seen: dict[str, bytes] = {}
    urls: list[str] = []

    def note(request: PageRequest) -> None:
        urls.append(request.url)

    page.on("request", note)
    await page.context.clear_cookies()
    without_key(page.context)
    await page.goto(f"{address.rstrip('/')}/robots/tello/")
    for passphrase in (WRONG, PASSPHRASE):
        await page.locator("[data-sign-in] [name=name]").fill("Ann")
        await page.locator("[data-sign-in] [name=passphrase]").fill(passphrase)
        await page.locator("[data-sign-in] [type=submit]").click()
        await page.wait_for_timeout(500)
    await page.locator("[data-verb=take]").wait_for()
    cookie = next(one for one in await page.context.cookies() if "sign-in" in one["name"])
    secrets["sign-in"] = cookie["value"]
    for path in PAGES:
        await page.goto(f"{address}{path}")
        seen[f"page /{path}"] = (await page.content()).encode()
    bearer = {"authorization": f"Bearer {token}"}
    async with httpx2.AsyncClient(timeout=30) as client:
        for name in CALLS:
            answer = await client.get(
                f"{address}api/v1/{name}", headers={"cookie": f"{cookie['name']}={cookie['value']}"}
            )
            assert answer.status_code == 200, (name, answer.text)
            seen[f"call {name}"] = answer.content
        wrong = await client.get(f"{address}api/v1/robots", headers={"authorization": "Bearer x"})
        assert wrong.status_code == 401
    place = urlsplit(address).netloc
    async with connect(f"ws://{place}/ws?robot=tello", additional_headers=bearer) as socket:
        await socket.send('{"t": "drive", "verb": "take"}')
        heard = [str(await asyncio.wait_for(socket.recv(), 20)) for _ in range(10)]
    seen["socket"] = "\n".join(heard).encode()
    seen["process list"] = processes()
    saved = run("backup", str(tmp_path / "backup.urc"), "--data-dir", str(data))
    assert saved.returncode == 0, saved.stderr
    files = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    own = {file for file in files if file.parent.name == "servers"}  # the start key, for its user
    assert await asyncio.to_thread(process.interrupt) == 0
    files |= {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    seen |= {f"file {file}": text for file, text in files.items() if file not in own}
    log = [line for line in (*process.output, *process.errors) if not line.startswith("dashboard ")]
    seen["log"] = "\n".join(log).encode()
    seen["addresses"] = "\n".join(urls).encode()

    assert [found_in(files[file], secrets) for file in own] == [["start key"]], "the search finds"
    leaks = {where: names for where, text in seen.items() if (names := found_in(text, secrets))}
    assert leaks == {}
    open_files = [
        file
        for file in data.rglob("*")
        if file.exists() and stat.S_IMODE(file.stat().st_mode) & 0o077
    ]
    assert [file for file in open_files if file.is_dir() or file.read_bytes()] == []
