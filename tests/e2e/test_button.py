"""The button in a real browser: one tap, one command, and what became of it."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Page, expect
from websockets.asyncio.client import connect
from websockets.typing import Origin

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.processes import UrcProcess
from urc.model.driver import Command, Reply
from urc.model.exchange import Confirm, Hold
from urc.model.interface import Interface, Layout, Slot, WidgetUse
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.values import Signal, Value
from urc.runtime.one_shot_commands import HELD
from urc.runtime.session import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import BEARER

pytestmark = pytest.mark.anyio

NOTE = ".button-note"
MAIN = ".button-main"

PROFILE = """\
urc: 1
kind: robot
name: bell
title: Bell
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: CRLF, rx: CRLF }
    timeouts: { reply: 20s }
commands:
  ring: { title: Ring the bell, send: "RING 1", reply: { regex: '^OK$', errors: ['^ERR.*'] } }
widgets:
  ring: { use: button, bind: { press: ring } }
interfaces:
  default: { grid: ring }
"""


class Bell:
    """A robot that keeps what it is sent, and answers as the test says."""

    def __init__(self) -> None:
        self.received = b""
        self.answer = b"OK\r\n"
        self._writers: list[asyncio.StreamWriter] = []

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        self._writers.append(writer)
        try:
            while data := await reader.read(4096):
                self.received += data
                writer.write(self.answer * data.count(b"\r\n"))
                await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()

    def cut(self) -> None:
        """Cut every connection."""
        for writer in self._writers:
            writer.transport.abort()


async def test_a_tap_is_one_command_to_the_byte(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """The robot gets exactly the frame; done and refused are told apart; lost is a reason."""
    bell = Bell()
    server = await asyncio.start_server(bell.talk, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    file = tmp_path / "bell.yaml"
    file.write_text(PROFILE.replace("PORT", str(port)), "utf-8")
    process = urc_process("serve", str(file), "--port", "0")
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    page = await new_page(size="phone")
    await page.goto(f"{address}robots/bell/")
    button = page.get_by_role("button", name="Ring the bell")
    await button.click()
    await until_text(page, NOTE, "✓ done")
    assert bell.received == b"RING 1\r\n"
    bell.answer = b"ERR no clapper\r\n"
    await button.click()
    await page.wait_for_selector(".button[data-phase='failed']")
    await expect(page.locator(NOTE)).to_contain_text("ERR no clapper")
    assert bell.received == b"RING 1\r\n" * 2
    server.close()
    bell.cut()
    await until_attribute(page, MAIN, "aria-disabled", "true")
    assert "◆ the robot is not connected" in await page.inner_text(NOTE)
    await button.click(force=True)
    assert bell.received == b"RING 1\r\n" * 2
    assert process.is_running


RING = Command("ring", "wire", WriteSpec("text"), title="Ring")
ASKED = RING._replace(reply=Reply(ReadSpec("regex")))


@asynccontextmanager
async def shown(
    page: Page, command: Command = RING, options: Mapping[str, object] | None = None
) -> AsyncIterator[FakeRobot]:
    """Show one button that is bound to `command`; give its robot."""
    use = WidgetUse("ring", "button", {}, {"press": "ring"}, options or {})
    robot = FakeRobot(dashboard_profile(uses=[use], commands={"ring": command}))
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until_attribute(page, MAIN, "aria-disabled", "false")
        yield robot


@pytest.mark.parametrize(("command", "word"), [(RING, "✓ sent"), (ASKED, "✓ done")])
async def test_what_nobody_confirms_is_sent_and_not_done(
    new_page: PageMaker, command: Command, word: str
) -> None:
    """Done is what a robot says; without an answer the command was only sent."""
    page = await new_page()
    async with shown(page, command) as robot:
        await page.click(MAIN)
        await until_text(page, NOTE, word)
        assert robot.commands == [("ring", {})]


async def test_a_command_under_way_locks_its_button(
    new_page: PageMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It says so, takes no second tap, and is free again with the answer, whatever it is."""
    page = await new_page()
    answered = asyncio.Event()
    ask = FakeRobot.command

    async def slow(
        robot: FakeRobot, name: str, arguments: Mapping[str, Value], **people: object
    ) -> object:
        reply = await ask(robot, name, arguments)
        await answered.wait()
        raise CommandFailed("timed-out", f"no answer to {reply.command}")

    monkeypatch.setattr(FakeRobot, "command", slow)
    async with shown(page, ASKED) as robot:
        await page.click(MAIN)
        await until_text(page, NOTE, "… waiting for the robot")
        await expect(page.locator(MAIN)).to_have_attribute("aria-busy", "true")
        await page.click(MAIN, force=True)
        await page.keyboard.press("Enter")
        answered.set()
        await until_text(page, NOTE, "▲ no answer to ring")
        await expect(page.locator(MAIN)).to_have_attribute("aria-disabled", "false")
        assert len(robot.commands) == 1


async def test_a_button_with_nothing_to_do_is_quiet_and_works(new_page: PageMaker) -> None:
    """The state may be wrong: a drone that says it is on the ground must still be able to land."""
    options = {"idle_in": ["on the ground"]}
    use = WidgetUse("ring", "button", {"state": "flight"}, {"press": "ring"}, options)
    signals = {"flight": Signal("flight", "string")}
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[use], commands={"ring": RING}))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("flight", "on the ground")
        await until_text(page, ".button-done", "already on the ground")
        await expect(page.locator(".button")).to_have_attribute("data-idle", "yes")
        await expect(page.locator(MAIN)).to_have_attribute("aria-disabled", "false")
        await page.click(MAIN)
        await until(lambda: len(robot.commands) == 1)
        robot.set_reading("flight", "in the air")
        await expect(page.locator(".button")).not_to_have_attribute("data-idle", "yes")


async def test_a_button_is_pressed_by_keyboard_once_a_stroke(new_page: PageMaker) -> None:
    """Enter and Space give it; a key that is held down gives it no second time."""
    page = await new_page()
    async with shown(page) as robot:
        await page.focus(MAIN)
        await page.keyboard.press("Enter")
        await until(lambda: len(robot.commands) == 1)
        await until_text(page, NOTE, "✓ sent")
        await page.keyboard.press("Space")
        await until(lambda: len(robot.commands) == 2)
        await until_text(page, NOTE, "✓ sent")
        for _ in range(5):
            await page.keyboard.down("Enter")  # from the second on, it repeats
            await until_text(page, NOTE, "✓ sent")
        await page.keyboard.up("Enter")
        assert len(robot.commands) == 3


async def test_a_question_is_asked_in_place(new_page: PageMaker) -> None:
    """Cancel, Escape and silence give nothing; the answer cannot be the tap that asked."""
    page = await new_page()
    page.on("dialog", lambda dialog: pytest.fail(f"a dialog opened: {dialog.message}"))
    async with shown(page, ASKED, {"label": "Erase", "confirm": "Erase the map?"}) as robot:
        await page.click(MAIN)
        await expect(page.get_by_role("group", name="Erase the map?")).to_be_visible()
        await expect(page.get_by_role("button", name="Cancel")).to_be_focused()
        await page.keyboard.press("Enter")
        await page.wait_for_selector(MAIN)
        await expect(page.locator(MAIN)).to_be_focused()
        await page.keyboard.press("Enter")
        await page.wait_for_selector(".button-yes:disabled")
        await page.keyboard.press("Escape")
        await page.wait_for_selector(MAIN)
        assert robot.commands == []
        await page.click(MAIN)
        await page.click(".button-yes")
        await until_text(page, NOTE, "✓ done")
        assert robot.commands == [("ring", {})]
        await page.click(MAIN)
        await page.wait_for_selector(".button-question")
        await page.wait_for_selector(MAIN)  # nobody answered
        assert len(robot.commands) == 1


async def test_a_question_falls_when_the_robot_is_lost(new_page: PageMaker) -> None:
    """Nothing that stands on the screen may be given later by surprise."""
    page = await new_page()
    async with shown(page, ASKED, {"confirm": "Sure?"}) as robot:
        await page.click(MAIN)
        await page.wait_for_selector(".button-question")
        robot.link("lost", "connection refused")
        await page.wait_for_selector(MAIN)
        await until_text(page, NOTE, "◆ the robot is not connected")
        robot.link("live")
        await until_text(page, NOTE, "")
        assert robot.commands == []


@pytest.mark.parametrize("confirm", ["", "Really?"])
async def test_a_button_is_large_enough_in_a_small_cell(new_page: PageMaker, confirm: str) -> None:
    """48 pixels at least, also for the answers, with a long label and a note."""
    signals = {"state": Signal("state", "string", stale_after_s=3)}
    options = {"label": "Calibrate all of it at once", **({"confirm": confirm} if confirm else {})}
    uses = [
        WidgetUse(f"b{n}", "button", {"state": "state"}, {"press": "ring"}, options)
        for n in range(2)
    ]
    profile = dashboard_profile(signals=signals, uses=uses, commands={"ring": RING})
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until_attribute(page, MAIN, "aria-disabled", "false")
        robot.set_reading("state", "idle")
        await until_text(page, ".button-value", "idle")
        if confirm:
            await page.click(MAIN)
        for button in await page.locator(".urc-cell button:visible").all():
            box = await button.bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 48
        cell = await page.locator(".urc-cell").first.bounding_box()
        note = await page.locator(NOTE).first.bounding_box()
        assert cell is not None
        assert note is not None
        assert note["y"] + note["height"] <= cell["y"] + cell["height"]


async def test_a_button_without_a_command_says_so(new_page: PageMaker) -> None:
    """There is nothing to press, and a line that tells why."""
    robot = FakeRobot(dashboard_profile(uses=[WidgetUse("b", "button", {"state": "battery"})]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until_text(page, NOTE, "◆ no command is bound to this button")
        assert await page.locator(".urc-cell button").count() == 0
        assert await page.locator(".urc-fault").count() == 0


async def test_a_line_that_is_made_for_each_command_needs_no_connection(
    new_page: PageMaker,
) -> None:
    """Lost is then only how the last one ended: the next command is what tries again."""
    page = await new_page()
    use = WidgetUse("ring", "button", {}, {"press": "ring"})
    profile = dashboard_profile(uses=[use], commands={"ring": RING})
    spec = profile.driver.transports["wire"]._replace(connection="per_request")
    driver = profile.driver._replace(transports={"wire": spec})
    robot = FakeRobot(profile._replace(driver=driver))
    async with running_dashboard(robot) as address:
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.link("lost", "connection refused")
        await until_text(page, "[data-badge-text]", "Robot lost")
        # The badge is there from the start, the button when its module has come.
        await page.wait_for_selector(f"{MAIN}[aria-disabled='false']")
        await page.click(MAIN)
        await until(lambda: robot.commands == [("ring", {})])


async def test_a_command_that_must_be_held_is_given_by_no_tap(new_page: PageMaker) -> None:
    """Given once it would never be stopped: the button is locked, and the server refuses it."""
    moving = RING._replace(hold=Hold(repeat_s=0.05))
    use = WidgetUse("ring", "button", {}, {"press": "ring"})
    robot = FakeRobot(dashboard_profile(uses=[use], commands={"ring": moving}))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until_text(page, "[data-badge-text]", "Live")
        await until_text(page, NOTE, f"◆ {HELD}")
        await page.click(MAIN, force=True)
        origin = address.rstrip("/")
        url = address.replace("http://", "ws://") + "ws?robot=puppet"
        async with connect(url, origin=Origin(origin), additional_headers=BEARER) as line:
            await line.send(json.dumps({"t": "run", "id": 1, "command": "ring"}))
            async with asyncio.timeout(30):
                while (reply := json.loads(await line.recv()))["t"] != "reply":
                    pass
        assert (reply["ok"], reply["code"], reply["message"]) == (False, "refused", HELD)
        assert robot.commands == []


HATCH = """() => {
  const main = document.querySelector(".button-main");
  const box = (el) => el.getBoundingClientRect();
  const text = document.createRange();
  text.selectNodeContents(document.querySelector(".button-label"));
  const [frame, words] = [box(main), text.getBoundingClientRect()];
  const note = document.querySelector(".button-note");
  return {
    isIn: words.top >= frame.top && words.bottom <= frame.bottom,
    isOffNote: !note.textContent || words.bottom <= box(note).top + 2,
    hatch: getComputedStyle(main).backgroundImage,
    isOffEnds: words.left >= frame.left + 6 && words.right <= frame.right - 6,
  };
}"""


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (1440, 900)])
@pytest.mark.parametrize("cells", [1, 3, 12])
async def test_the_button_of_a_hazard_has_hatched_ends_at_every_size(
    new_page: PageMaker, size: tuple[int, int], cells: int
) -> None:
    """Neither its name nor a note lies on the hatch or on each other."""
    hazard = Confirm(level="hazardous", text="The drone will fall.")
    cut = Command("cut", "wire", WriteSpec("text", {}), confirm=hazard)
    signals = {"at": Signal("at"), "eye": Signal("eye", "image")}
    names = ["cut", *(f"v{place}" for place in range(cells - 1))]
    uses = [
        WidgetUse("cut", "button", {}, {"press": "cut"}, title="Cut the motors"),
        *(WidgetUse(name, "value", {"value": "at"}) for name in names[1:]),
        WidgetUse("eye", "camera", {"image": "eye"}),
    ]
    slots = tuple(Slot(name, *divmod(place, 3)) for place, name in enumerate(names))
    grid = Layout(-(-cells // 3), min(cells, 3), slots)
    profile = dashboard_profile(signals=signals, uses=uses, commands={"cut": cut})
    interface = Interface("x", "X", {"landscape": grid, "phone_portrait": grid}, background="eye")
    robot = FakeRobot(profile._replace(interfaces={"x": interface}))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.set_viewport_size({"width": size[0], "height": size[1]})
        await page.goto(f"{address}robots/puppet/")
        await until_text(page, NOTE, "")
        seen = await page.evaluate(HATCH)
        assert (seen["isIn"], seen["isOffEnds"]) == (True, True), seen
        assert "repeating-linear-gradient" in seen["hatch"]
        await page.evaluate(
            "document.querySelector('.button-note').textContent = '▲ refused: not in the air'"
        )
        noted = await page.evaluate(HATCH)
        assert (noted["isIn"], noted["isOffNote"], noted["isOffEnds"]) == (True, True, True), noted
