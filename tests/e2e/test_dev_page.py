"""The dev page in a real browser: traffic of any transport, questions, and reload on every save."""

import asyncio
import json
import re
from pathlib import Path

import pytest
from playwright.async_api import Page, expect
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.dev_pages import LAMP, PICTURE, ROBOT, WORD, Start, served
from tests.e2e.keys import headers_for
from tests.e2e.transports.test_mqtt import broker, publish

pytestmark = pytest.mark.anyio

ANSWERED = re.compile("✓ done|no connection to URC")


async def test_the_traffic_is_shown_without_its_secret(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Sent and received, in hex and text, faults in their place; a password nowhere."""
    page = await new_page()
    async with served(page, urc_process, tmp_path) as (bell, _, _):
        row = page.locator(".dev-row[data-kind='received']", has_text=r"BAT 12\r\n")
        await expect(row).to_contain_text("42 41 54 20 31 32 0d 0a")
        await expect(page.locator(".dev-row[data-kind='sent']").first).to_contain_text("‹secret›")
        await expect(page.locator(".dev-row[data-kind='note']", has_text="live")).to_have_count(1)
        await expect(page.locator("[data-signals] tr")).to_contain_text("12 %")
        await expect(page.locator("[data-signals] tr")).to_contain_text("▲ low")
        assert bell.lines[0] == f"LOGIN {WORD}\r\n".encode()
        text = await page.inner_text("body")
        assert WORD not in text
        assert WORD.encode().hex(" ") not in text


async def test_the_log_is_filtered_paused_copied_and_cleared(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """What is filtered out is not copied; what came meanwhile is shown after a pause."""
    page = await new_page()
    await page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    async with served(page, urc_process, tmp_path):
        rows = page.locator(".dev-row:visible")
        await expect(rows.filter(has_text="BAT 12")).to_have_count(1)
        await page.select_option("[data-filter-kind]", "sent")
        await expect(rows).to_have_count(1)
        await page.click("[data-copy]")
        await expect(page.locator("[data-log-state]")).to_have_text("1 rows are in the clipboard")
        copied = await page.evaluate("navigator.clipboard.readText()")
        assert "→ sent" in copied
        assert "BAT" not in copied
        await page.click("[data-pause]")
        await page.get_by_text("ring", exact=True).click()
        await page.get_by_role("button", name="Send").first.click()
        await expect(page.locator("[data-log-state]")).to_contain_text("Paused: 2 wait")
        await expect(rows).to_have_count(1)
        await page.click("[data-pause]")
        await expect(rows.last).to_contain_text(r"RING 1\r\n")
        await page.click("[data-clear]")
        await expect(rows).to_have_count(0)


async def test_commands_are_previewed_and_given(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """A preview sends nothing; a refusal is in words; a question is asked before."""
    page = await new_page()
    async with served(page, urc_process, tmp_path) as (bell, _, _):
        await until(lambda: len(bell.lines) == 1)
        ring = page.locator(".dev-command", has_text="Ring the bell")
        await ring.locator("summary").click()
        await ring.get_by_label("times").fill("3")
        await page.keyboard.press("Enter")
        await expect(ring.locator(".dev-result")).to_contain_text("52 49 4e 47 20 33 0d 0a")
        await expect(ring.locator(".dev-result")).to_contain_text(r"RING 3\r\n")
        await ring.get_by_label("times").fill("10")
        await ring.get_by_role("button", name="Preview").click()
        await expect(ring.locator(".dev-bad")).to_have_text(
            "▲ refused: times: 10 is above its maximum 9"
        )
        await ring.get_by_role("button", name="Send").click()
        await expect(ring.locator(".dev-bad")).to_contain_text("above its maximum")
        assert len(bell.lines) == 1
        await ring.get_by_label("times").fill("2")
        await ring.get_by_role("button", name="Send").click()
        await expect(ring.locator(".dev-result")).to_contain_text("✓ done")
        assert bell.lines[1:] == [b"RING 2\r\n"]
        melt = page.locator(".dev-command", has_text="melt")
        await melt.locator("summary").click()
        await melt.get_by_role("button", name="Send").click()
        await expect(melt).to_contain_text("it asks: It will not be a bell any more.")
        assert len(bell.lines) == 2
        await melt.get_by_role("button", name="Yes, send it").click()
        await expect(melt.locator(".dev-result")).to_contain_text("✓ done")
        await until(lambda: bell.lines[-1] == b"MELT\r\n")


async def test_the_parser_is_tried_on_what_is_pasted(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """By keyboard alone; the robot's own values do not change."""
    page = await new_page()
    async with served(page, urc_process, tmp_path):
        await expect(page.locator("[data-signals] tr")).to_contain_text("12 %")
        await page.get_by_label("What the robot sends").focus()
        await page.keyboard.type(r"BAT 99\r\nBAT x\r\nBA")
        await page.keyboard.press("Control+Enter")
        tried = page.locator("[data-tried]")
        await expect(tried).to_contain_text("17 bytes: 2 frames by delimiter")
        pieces = tried.locator(".dev-piece")
        await expect(pieces.first).to_contain_text("✓ taken by message level")
        await expect(pieces.first).to_contain_text("signal battery = 99")
        await expect(pieces.last).to_contain_text("nobody takes it")
        await expect(tried).to_contain_text("2 bytes at the end begin a frame and do not end it")
        await page.get_by_label("Written as").select_option("hex")
        await page.get_by_label("What the robot sends").fill("42 4x")
        await page.get_by_role("button", name="Try").click()
        await expect(tried).to_contain_text("▲ expected pairs of hex digits; group 2 is '4x'")
        await expect(page.locator("[data-signals] tr")).to_contain_text("12 %")


async def test_a_save_is_loaded_and_a_mistake_changes_nothing(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Findings with line and caret while the old version runs; the next good one takes over."""
    page = await new_page()
    async with served(page, urc_process, tmp_path) as (bell, file, address):
        await until(lambda: len(bell.lines) == 1)
        good = file.read_text("utf-8")
        file.write_text(good.replace("type: integer, unit", "type: intger, unit"), "utf-8")
        state = page.locator("[data-profile-state]")
        await expect(state).to_contain_text("the previous version keeps running")
        finding = page.locator(".dev-finding")
        await expect(finding).to_contain_text("bell.yaml:18:20: error")
        await expect(finding).to_contain_text("^^^^^^")
        ring = page.locator(".dev-command", has_text="Ring the bell")
        await ring.locator("summary").click()
        await ring.get_by_role("button", name="Send").click()
        await expect(ring.locator(".dev-result")).to_contain_text("✓ done")
        file.write_text(good + "  hum: { title: Hum, send: HUM }\n", "utf-8")
        await expect(state).to_contain_text("was saved and is now running")
        await expect(finding).to_have_count(0)
        await until(lambda: sum(line.startswith(b"LOGIN") for line in bell.lines) == 2)
        hum = page.locator(".dev-command", has_text="Hum")
        await hum.locator("summary").click()
        while bell.lines[-1] != b"HUM\r\n":
            # A page that is just being connected anew says so, and sends nothing: once more, then.
            await hum.get_by_role("button", name="Send").click()
            await expect(hum.locator(".dev-result")).to_contain_text(ANSWERED)
        await page.goto(f"{address}robots/bell/")
        await page.wait_for_selector("[data-badge]")


async def test_an_emulated_robot_is_emulated_anew(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """A save changes the robot and its twin alike, and a page stays connected."""
    file = tmp_path / "bell.yaml"
    text = ROBOT.replace("PORT", "7001").split("    on_connect", maxsplit=1)
    text[1] = text[1].partition("signals:")[2]
    file.write_text("signals:".join(text), "utf-8")
    words = ("serve", str(file), "--simulate", "--dev", "--port", "0")
    process = urc_process(*words, "--data-dir", str(tmp_path / "data"))
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    page = await new_page()
    await page.goto(f"{address}robots/bell/dev")
    level = page.locator(".dev-row[data-kind='received']", has_text="BAT ")
    await expect(level.first).to_be_visible()
    file.write_text(file.read_text("utf-8").replace("BAT (", "LEVEL ("), "utf-8")
    await expect(page.locator("[data-profile-state]")).to_contain_text("was saved")
    renamed = page.locator(".dev-row[data-kind='received']", has_text="LEVEL ")
    await expect(renamed.first).to_be_visible()
    await expect(page.locator("[data-badge-text]")).to_have_text("Live")
    await page.goto("about:blank")


@pytest.mark.needs("mosquitto")
@pytest.mark.needs("mosquitto-clients")
async def test_messages_are_shown_with_verb_and_address(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """On MQTT: what is published and what comes, and a message to try with its topic."""
    file = tmp_path / "lamp.yaml"
    file.write_text(LAMP, "utf-8")
    words = ("serve", str(file), "--set", f"password={WORD}", "--dev", "--port", "0")
    page = await new_page()
    async with broker(tmp_path) as port:
        folder = ("--set", f"port={port}", "--data-dir", str(tmp_path / "data"))
        process = urc_process(*words, *folder)
        address = (await process.wait_for_async(r"(http://\S+)"))[1]
        await page.goto(f"{address}robots/lamp/dev")
        await talk_over_the_broker(page, port)


async def publish_bytes(port: int, topic: str, data: bytes) -> None:
    """Say something that is no text."""
    process = await asyncio.create_subprocess_exec(
        "mosquitto_pub", "-p", str(port), "-t", topic, "-s", stdin=asyncio.subprocess.PIPE
    )
    async with asyncio.timeout(30):
        await process.communicate(data)
    assert process.returncode == 0


async def talk_over_the_broker(page: Page, port: int) -> None:
    """Say something, hear something, try something."""
    connected = page.locator(".dev-row", has_text="connecting to mqtt")
    await expect(connected).to_have_count(1)
    await page.locator(".dev-command summary").click()
    await page.get_by_label("lit (boolean)").select_option("true")
    await page.get_by_role("button", name="Preview").click()
    await expect(page.locator(".dev-result").last).to_contain_text("publish lamp/set")
    await page.get_by_role("button", name="Send").click()
    sent = page.locator(".dev-row[data-kind='sent']")
    await expect(sent.last).to_contain_text("publish lamp/set")
    await expect(sent.last).to_contain_text("true")
    await publish(port, "lamp/state", '{"on": true}')
    received = page.locator(".dev-row[data-kind='received']")
    await expect(received.first).to_contain_text("message lamp/state")
    await publish_bytes(port, "lamp/state", PICTURE)
    picture = page.locator(".dev-row img")
    await expect(picture).to_have_count(1)
    await page.wait_for_function("() => document.querySelector('.dev-row img').naturalWidth === 1")
    shown = page.locator(".dev-row", has=page.locator("img"))
    await expect(shown).to_contain_text(f"<{len(PICTURE)} bytes, image/png>")
    await page.get_by_label("Topic").fill("lamp/state")
    await page.get_by_label("What the robot sends").fill('{"on": false}')
    await page.get_by_role("button", name="Try").click()
    await expect(page.locator("[data-tried]")).to_contain_text("signal lit = False")
    assert WORD not in await page.content()


def joined(url: str, address: str) -> connect:
    """Return a connection to a socket of the server at `address`, as its own page makes it."""
    headers = headers_for(address)
    origin = Origin(address.rstrip("/"))
    return connect(url, origin=origin, additional_headers=headers, compression=None)


async def test_without_dev_there_is_no_such_page(urc_process: Start, tmp_path: Path) -> None:
    """One line says how to turn it on; its socket is not there either."""
    file = tmp_path / "lamp.yaml"
    file.write_text(LAMP.replace("secret: true", "default: x"), "utf-8")
    process = urc_process("serve", str(file), "--port", "0", "--data-dir", str(tmp_path / "data"))
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    port = int(address.rstrip("/").rpartition(":")[2])
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    head = f"GET /robots/lamp/dev HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close"
    head += "".join(f"\r\n{name}: {value}" for name, value in headers_for(address).items())
    writer.write(f"{head}\r\n\r\n".encode())
    async with asyncio.timeout(30):
        answer = (await reader.read()).decode()
    writer.close()
    assert answer.startswith("HTTP/1.1 404 ")
    assert "The developer page is disabled. Start URC with --dev to enable it." in answer
    url = address.replace("http://", "ws://") + "robots/lamp/dev/ws"
    with pytest.raises(InvalidStatus, match="404"):
        async with joined(url, address):
            pass


def test_dev_is_for_this_machine_alone(urc_process: Start, tmp_path: Path) -> None:
    """It shows everything that goes over the lines, so nobody else may reach it."""
    file = tmp_path / "lamp.yaml"
    file.write_text(LAMP, "utf-8")
    process = urc_process("serve", str(file), "--dev", "--host", "0.0.0.0", "--port", "0")
    assert process.wait() == 2
    assert process.errors == [
        "urc serve: --dev shows all traffic, so it is allowed only on this machine;"
        " found --host 0.0.0.0"
    ]


async def test_a_foreign_page_cannot_listen(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """The same policy as everywhere: only our own origin opens the socket."""
    page = await new_page()
    async with served(page, urc_process, tmp_path) as (_, _, address):
        url = address.replace("http://", "ws://") + "robots/bell/dev/ws"
        with pytest.raises(InvalidStatus, match="403"):
            async with connect(url, origin=Origin("http://example.com")):
                pass
        async with joined(url, address) as line:
            async with asyncio.timeout(30):
                assert json.loads(await line.recv())["t"] == "hello"


@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_the_page_fits_every_screen(
    new_page: PageMaker, urc_process: Start, tmp_path: Path, size: Size
) -> None:
    """Nothing is wider than the screen, every control is large enough, all have names."""
    page = await new_page(size=size)
    async with served(page, urc_process, tmp_path):
        await expect(page.locator(".dev-row", has_text="BAT 12")).to_have_count(1)
        await page.locator(".dev-command summary").first.click()
        width = await page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert width <= 0
        controls = page.locator("button:visible, select:visible, input:visible, summary:visible")
        for control in await controls.all():
            box = await control.bounding_box()
            assert box is not None
            assert box["height"] >= 48
        names = await page.evaluate(
            "[...document.querySelectorAll('select, input, textarea')]"
            ".filter((el) => !el.labels?.length).length"
        )
        assert names == 0
