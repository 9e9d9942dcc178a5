"""Recordings as people make and play them: real processes, a real file, a real browser."""

import asyncio
import json
import os
import re
import signal
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path

import httpx2
import pytest
from mcap.reader import make_reader
from playwright.async_api import Page, expect
from websockets.asyncio.client import connect

from tests.e2e.axe import faults, prepare
from tests.e2e.command_line import PUPPET, at, run
from tests.e2e.conftest import PageMaker
from tests.e2e.keys import headers_for
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from urc.problems import UrcError
from urc.runtime.recording.reader import open_recording

pytestmark = [pytest.mark.anyio, pytest.mark.needs("chromium")]

Start = Callable[..., UrcProcess]

ROVER = """\
urc: 1
kind: robot
name: rover
title: Rover
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 7001 }
  word: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect:
      - { send: "LOGIN {{ settings.word }}" }
signals:
  battery: { type: integer, unit: "%" }
commands:
  drive:
    send: "M {{ speed }}"
    args: { speed: { type: integer, min: -100, max: 100 } }
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
  lamp: { send: "L" }
polls:
  - { every: 100ms, send: "B", reply: { regex: '^(?P<battery>\\d+)$' } }
widgets:
  level: { use: value, bind: { value: battery } }
  stick:
    use: joystick
    bind: { moved: { command: drive, args: { x: speed } } }
    options: { axes: x }
  lamp: { use: button, bind: { press: lamp } }
  line: { use: link }
interfaces:
  default: { grid: "level stick lamp line" }
simulator:
  wire:
    - { match: '^B$', send: "{{ 40 + (now | int) % 20 }}" }
"""


def topics_of(file: Path) -> Counter[str]:
    """Count the messages of a recording by the reader of the format's authors, index and all."""
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return Counter(channel.topic for _, channel, _ in reader.iter_messages())


def puppet(urc_process: Start) -> int:
    port = free_port()
    urc_process("simulate", PUPPET, "--set", f"port={port}").wait_for("listening")
    return port


def grown(record: UrcProcess, file: Path) -> None:
    """Return when some of what happened is in a file as it grows."""
    while True:
        assert record.is_running
        with suppress(UrcError):  # nothing is in it yet
            if any("battery" in one.topic for one in open_recording(file).messages(0)):
                return
        time.sleep(0.05)


def test_a_recording_ends_with_its_time(urc_process: Start, tmp_path: Path) -> None:
    file = tmp_path / "puppet.mcap"
    done = run("record", PUPPET, *at(puppet(urc_process)), "--for", "2500ms", "-o", str(file))
    assert done.returncode == 0, done.stderr
    topics = topics_of(file)
    assert topics["/signals/battery"] >= 2
    assert topics["/wire/wire"] >= 4
    said = (
        f"{file}: {topics['/signals/battery']} readings of 1 signal, {topics['/wire/wire']} pieces"
    )
    assert done.stdout.startswith(said)


def test_a_recording_ends_whole_with_a_signal(urc_process: Start, tmp_path: Path) -> None:
    file = tmp_path / "puppet.mcap"
    record = urc_process("record", PUPPET, *at(puppet(urc_process)), "-o", str(file))
    record.wait_for("recording .*puppet.mcap; Ctrl-C ends it")
    grown(record, file)
    assert record.interrupt() == 0
    assert sum(topics_of(file).values()) > 0


def test_one_that_is_killed_loses_its_end_and_no_more(urc_process: Start, tmp_path: Path) -> None:
    file = tmp_path / "puppet.mcap"
    record = urc_process("record", PUPPET, *at(puppet(urc_process)), "-o", str(file))
    record.wait_for("recording")
    grown(record, file)
    os.kill(record.pid, signal.SIGKILL)
    replay = urc_process("replay", str(file), "--port", "0")
    replay.wait_for("dashboard http")
    (said,) = replay.errors
    assert said.startswith(f"urc replay: {file} ")


def test_a_robot_that_is_not_there_is_told(tmp_path: Path) -> None:
    file = tmp_path / "puppet.mcap"
    done = run("record", PUPPET, *at(free_port()), "--for", "500ms", "-o", str(file))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("urc record: no reading was received: nothing")
    assert topics_of(file)["/link/wire"] > 0  # what did happen is kept all the same


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nosuch.mcap",), "urc replay: nosuch.mcap cannot be read: No such file or directory"),
        ((PUPPET,), f"urc replay: {PUPPET} is not an MCAP file"),
        (
            ("x.mcap", "--speed", "0"),
            "urc replay: argument --speed: expected a speed from 0.1 to 100, found '0'; try"
            " 'urc replay --help'",
        ),
    ],
)
def test_what_cannot_be_played_is_told_in_one_line(words: tuple[str, ...], said: str) -> None:
    done = run("replay", *words)
    assert done.returncode in (1, 2)
    assert done.stderr.splitlines() == [said]


@pytest.fixture
async def recording(urc_process: Start, new_page: PageMaker, tmp_path: Path) -> Path:
    """The file of a short drive by a browser, through a dashboard that records."""
    robot, folder = tmp_path / "rover.yaml", tmp_path / "kept"
    robot.write_text(ROVER)
    words = ["--simulate", "--port", "0", "--data-dir", str(tmp_path), "--record", str(folder)]
    words += ["--set", "word=open-sesame"]
    dashboard = urc_process("serve", str(robot), *words)
    address = (await dashboard.wait_for_async(r"dashboard (http\S+)"))[1]
    page = await new_page()
    await page.goto(f"{address}robots/rover/")
    await expect(page.locator("[data-badge-text]")).to_have_text("Live")
    pad = await page.locator(".joystick-pad").bounding_box()
    assert pad is not None
    x, y = pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x, y - 40)
    await expect(page.locator(".joystick")).to_have_attribute("data-phase", "held")
    await asyncio.sleep(1.0)
    await page.mouse.up()
    await page.locator(".button-press, .button button").first.click()
    await asyncio.sleep(1.0)
    await page.close()
    assert await asyncio.to_thread(dashboard.interrupt) == 0
    (file,) = folder.iterdir()
    return file


async def test_a_robot_that_cannot_be_recorded_is_driven_all_the_same(
    urc_process: Start, new_page: PageMaker, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    folder = str(tmp_path / "file" / "kept")
    dashboard = urc_process("serve", PUPPET, "--simulate", "--port", "0", "--record", folder)
    address = (await dashboard.wait_for_async(r"dashboard (http\S+)"))[1]
    page = await new_page()
    await page.goto(f"{address}robots/puppet/")
    await expect(page.locator("[data-badge-text]")).to_have_text("Live")
    said = page.locator("[data-log]")
    await expect(said).to_contain_text("recording: nothing is recorded: ")
    await expect(said).to_contain_text("cannot be created: Not a directory")
    await page.close()
    assert await asyncio.to_thread(dashboard.interrupt) == 0
    assert any("puppet: " in line and "Not a directory" in line for line in dashboard.errors)


@pytest.fixture
async def replayed(recording: Path, urc_process: Start) -> AsyncIterator[str]:
    """The address of the recording's page."""
    replay = urc_process("replay", str(recording), "--port", "0")
    address = (await replay.wait_for_async(r"dashboard (http\S+)"))[1]
    yield f"{address}robots/rover/"
    assert not [line for line in replay.errors if "mistake" in line or "Traceback" in line]


async def test_a_drive_is_recorded_with_who_drove_and_without_secrets(recording: Path) -> None:
    topics = topics_of(recording)
    for topic in ("/signals/battery", "/wire/wire", "/link/wire", "/log", "/driving"):
        assert topics[topic] > 0, topic
    with recording.open("rb") as stream:
        found = [
            (channel.topic, message.data)
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    driven = [json.loads(data)["what"] for topic, data in found if topic == "/driving"]
    assert "moved" in driven
    assert "ran" in driven
    speeds = [json.loads(data)["speed"] for topic, data in found if topic == "/commands/drive"]
    assert max(speeds) > 0
    assert speeds[-1] == 0
    assert not any(b"open-sesame" in data for topic, data in found)


async def test_a_recording_is_played_on_the_same_page(replayed: str, new_page: PageMaker) -> None:
    """It runs, stands, and goes on elsewhere; nobody takes it for a robot."""
    page = await prepare(await new_page())
    await page.goto(replayed)
    await expect(page.locator(".value-figure")).to_have_text(re.compile("[0-9]+"))
    await expect(page.locator("[data-badge-text]")).to_have_text("Replay")
    await expect(page.locator(".link-now")).to_have_text("Replay")
    await expect(page.locator("[data-stop-button]")).to_have_count(0)
    await expect(page.locator(".joystick-note")).to_have_text("◆ this page only watches")
    await page.get_by_role("button", name="Pause").click()
    await expect(page.get_by_role("button", name="Play")).to_be_visible()
    place = page.get_by_role("slider", name="Position in the recording")
    length = float(await place.get_attribute("max") or 0)
    assert length > 2
    await place.fill(str(round(length / 2, 1)))
    await expect(page.locator("[data-tape-time]")).to_contain_text(f"0:0{int(length / 2)} /")
    await page.get_by_role("button", name="Play").click()
    await expect(page.locator("[data-tape-note]")).to_have_text("The recording has ended.")
    await _keyboard_moves_it(page)
    assert await faults(page) == []


async def _keyboard_moves_it(page: Page) -> None:
    place = page.get_by_role("slider", name="Position in the recording")
    await place.focus()
    await place.press("Home")
    await expect(page.locator("[data-tape-time]")).to_contain_text("0:00 /")


async def test_nothing_is_commanded_through_a_recording(replayed: str) -> None:
    """Whatever is sent by hand: no lease, no stop, no command."""
    origin = replayed.partition("/robots/")[0]
    key = headers_for(origin)
    async with httpx2.AsyncClient(base_url=origin, headers={"origin": origin, **key}) as client:
        stopped = await client.post("/api/v1/robots/rover/stop")
        assert stopped.status_code == 409
        for body in ({"positionS": 1e999}, {"positionS": "far"}, {"other": 1}):
            text = json.dumps(body).replace("Infinity", "1e999")
            head = {"content-type": "application/json"}
            path = "/api/v1/robots/rover/recording/move"
            answer = await client.post(path, content=text, headers=head)
            assert answer.status_code in (200, 400)
        state = (await client.get("/api/v1/robots/rover/recording")).json()
        assert 0 <= state["positionS"] <= state["lengthS"]
    line = replayed.partition("//")[2].partition("/")[0]
    said = []
    async with connect(
        f"ws://{line}/ws?robot=rover", origin=origin, additional_headers=key
    ) as socket:
        for message in (
            {"t": "take"},
            {"t": "stop"},
            {"t": "run", "id": 1, "command": "lamp", "arguments": {}},
            {"t": "run", "id": 2, "command": "drive", "arguments": {"speed": 9}},
        ):
            await socket.send(json.dumps(message))
        async with asyncio.timeout(20):
            while not (any(one["t"] == "reply" and one["id"] == 2 for one in said)):
                got = await socket.recv()
                said += [json.loads(got)] if isinstance(got, str) else []
    replies = [one for one in said if one["t"] == "reply"]
    assert [one.get("code", "") != "" for one in replies] == [True, True]
    leases = [one for one in said if one["t"] == "lease"]
    assert not any(one.get("drives") or one.get("latched") for one in leases)
