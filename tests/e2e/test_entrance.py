"""The way in, with real programs and a real browser: the printed key, and what a restart does."""

import json
import os
import re
import signal
import stat
import time
from collections.abc import Callable
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from playwright.async_api import expect

from tests.e2e.command_line import PUPPET, TIMEOUT_S
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.keys import headers_for
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from urc.access.grants import Grant
from urc.access.store import AccessStore
from urc.runtime.running_servers import servers

pytestmark = pytest.mark.anyio

Start = Callable[..., UrcProcess]
TELLO = "robots/tello.yaml"


def start(urc_process: Start, data: Path, *more: str, port: int = 0) -> tuple[UrcProcess, str]:
    """Start the dashboard; give it and its address."""
    words = ("serve", TELLO, "--simulate", "--port", str(port), "--data-dir", str(data), *more)
    process = urc_process(*words)
    return process, process.wait_for(r"^dashboard (http://\S+)")[1]


def key_of(address: str) -> str:
    """Return the key that was printed with an address."""
    return headers_for(address)["Authorization"].removeprefix("Bearer ")


def asked(url: str, method: str = "GET", **headers: str) -> tuple[int, str]:
    """Return status and text of an answer."""
    request = Request(url, headers=headers, method=method)  # noqa: S310 (URC's own address)
    try:
        with urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
            return answer.status, answer.read().decode()
    except HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_a_program_sends_the_key_and_a_stranger_only_stops(
    urc_process: Start, tmp_path: Path
) -> None:
    """As `curl -H "Authorization: Bearer KEY"`, without an Origin."""
    _, address = start(urc_process, tmp_path)
    key = headers_for(address)
    assert asked(address)[0] == 401
    assert "Tello" in asked(address, **key)[1]
    stop = f"{address}api/v1/robots/tello/stop"
    assert asked(stop, "POST", **key)[0] == 200
    assert asked(stop, "POST", Origin=address.rstrip("/"))[0] == 200
    assert asked(stop, "POST", Origin="http://evil.example", **key)[0] == 403
    behind_a_proxy = {"X-Forwarded-For": "203.0.113.9", "Forwarded": "for=203.0.113.9"}
    assert asked(address, **behind_a_proxy)[0] == 401


def test_other_programs_of_this_user_find_the_server(urc_process: Start, tmp_path: Path) -> None:
    """Its file is theirs alone, holds what is needed to ask it, and goes with it."""
    process, address = start(urc_process, tmp_path, "--host", "0.0.0.0")
    port = address.rstrip("/").rpartition(":")[2]
    (found,) = servers(tmp_path).values()
    assert found.address == f"http://127.0.0.1:{port}/"
    assert found.pid == process.pid
    assert found.key == key_of(address)
    (file,) = (tmp_path / "servers").iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    timeline = f"{found.address}api/v1/robots/tello/timeline"
    assert asked(timeline, Authorization=f"Bearer {found.key}")[0] == 200
    assert asked(timeline)[0] == 401
    assert process.end(signal.SIGTERM) == 0
    assert not servers(tmp_path)


async def test_a_tab_that_outlives_a_restart_says_what_to_do(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """STOP still works from it; once the new address was opened, it goes on by itself."""
    port = free_port()
    process, address = start(urc_process, tmp_path, port=port)
    page = await new_page()
    new_page.allow(page, lambda text: "WebSocket" in text or "ERR_CONNECTION_RE" in text)
    await page.goto(f"{address}robots/tello/")
    badge = page.locator("[data-badge]")
    await expect(badge).to_have_attribute("data-state", "good")
    old = key_of(address)
    process.kill()

    process, address = start(urc_process, tmp_path, port=port)
    assert key_of(address) != old
    note = page.locator("[data-note]")
    await expect(note).to_have_text(
        "URC was restarted: open the address that it printed; this page then continues."
    )
    await page.locator("[data-stop-button]").dispatch_event("pointerdown")
    latch = tmp_path / "latches" / "emulated" / "tello.latch.json"
    await until(lambda: latch.exists() and json.loads(latch.read_text("utf-8"))["latched_by"])

    second = await page.context.new_page()
    await second.goto(f"{address}?key={key_of(address)}")
    await expect(second.locator("h1")).to_contain_text("URC")
    await second.wait_for_url(address)
    await expect(badge).to_have_attribute("data-state", "good")
    await expect(note).to_have_text("")


async def test_the_page_at_the_door_stops_a_robot(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """A browser without the key, on any address of the server; scripts never see the cookie."""
    _, address = start(urc_process, tmp_path)
    page = await new_page(size="phone")
    new_page.allow(page, lambda text: "401" in text)
    key = key_of(address)
    await page.evaluate("address => location.assign(address)", f"{address}robots/tello/")
    await expect(page.locator("h1")).to_have_text("Open the printed address")
    await page.get_by_role("button", name="STOP").click()
    await expect(page.get_by_role("status")).to_have_text(re.compile("confirmed the stop$"))
    latch = tmp_path / "latches" / "emulated" / "tello.latch.json"
    await until(lambda: latch.exists() and json.loads(latch.read_text("utf-8"))["latched_by"])
    await page.evaluate("address => location.assign(address)", f"{address}robots/tello/?key={key}")
    await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
    assert page.url == f"{address}robots/tello/"
    assert "urc-start" not in await page.evaluate("document.cookie")
    assert "key" not in await page.evaluate("document.referrer")


async def test_the_key_stands_nowhere_but_in_its_file(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Not in the log, the audit, or whatever else is kept; the browser's cache has no address."""
    process, address = start(urc_process, tmp_path, "--record", str(tmp_path / "kept"))
    page = await new_page(is_kept=True)
    key = key_of(address)
    await page.goto(f"{address}robots/tello/")
    await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
    await page.goto(f"{address}?key={key}")
    await page.wait_for_url(address)
    await page.goto(f"{address}robots/tello/")
    await page.locator("[data-stop-button]").dispatch_event("pointerdown")
    await expect(page.locator("[data-stop-button]")).to_have_attribute(
        "data-phase", re.compile("latched|confirmed")
    )
    kept = await page.evaluate(
        """async () => (await Promise.all((await caches.keys()).map(async (name) =>
          (await (await caches.open(name)).keys()).map((one) => one.url)))).flat()"""
    )
    assert not [url for url in kept if key in url]
    await page.goto("about:blank")
    assert process.end(signal.SIGTERM) == 0
    assert not [line for line in process.output + process.errors if key in line]
    holding = [
        file
        for folder, _, names in os.walk(tmp_path)
        for file in (Path(folder, name) for name in names)
        if key.encode() in file.read_bytes()
    ]
    assert holding == []


def test_sign_in_is_switched_off_only_for_a_network_and_by_name(
    urc_process: Start, tmp_path: Path
) -> None:
    """Then everyone drives, each page says so in red, and settings still need a sign-in."""
    process = urc_process("serve", PUPPET, "--port", "0", "--without-sign-in")
    assert process.wait() == 2
    assert process.errors[0].startswith("urc serve: --without-sign-in is for other machines")
    _, address = start(urc_process, tmp_path, "--host", "0.0.0.0", "--without-sign-in")
    status, page = asked(address)
    assert status == 200
    assert "Sign-in is off: everyone on this network can drive these robots." in page
    own = {"Origin": address.rstrip("/"), "Content-Type": "application/json"}
    assert asked(f"{address}api/v1/packages/back", "POST", **own)[0] == 403


def test_a_person_of_the_data_folder_stays_signed_in_after_a_restart(
    urc_process: Start, tmp_path: Path
) -> None:
    """And a removal by another process acts on the running server."""
    store = AccessStore(tmp_path)
    ann = store.add("person", "Ann", [Grant("watch")], now=time.time())
    _, secret = store.open_sign_in(ann.id, "passphrase", now=time.time())
    cookie = {"Cookie": f"urc-sign-in-{store.instance()}={secret}"}
    for _ in range(2):
        process, address = start(urc_process, tmp_path, "--host", "0.0.0.0")
        assert asked(f"{address}robots/tello/", **cookie)[0] == 200
        assert asked(f"{address}robots/tello/")[0] == 401
        assert process.end(signal.SIGTERM) == 0
    _, address = start(urc_process, tmp_path, "--host", "0.0.0.0")
    store.remove(ann.id)
    end = time.monotonic() + 10
    while asked(f"{address}robots/tello/", **cookie)[0] != 401:
        assert time.monotonic() < end
    store.close()
