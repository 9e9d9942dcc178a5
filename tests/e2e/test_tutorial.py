"""The tutorial, done as it is written: every file, every command, and what it says of each."""

import asyncio
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from playwright.async_api import Page

from tests.documentation import TUTORIAL, Block, blocks
from tests.e2e.conftest import PageMaker
from tests.e2e.keys import learn
from tests.e2e.ports import free_port
from tests.e2e.processes import ROOT

pytestmark = pytest.mark.anyio

TIMEOUT_S = 60.0
LASTING = re.compile(r"urc (simulate|serve|repo serve) ")
PORTS = ("6789", "8080", "8090")


class Reader:
    """Somebody who does what the page says, in a folder for just that."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        programs = folder / ".bin"
        programs.mkdir()
        (programs / "urc").write_text(f'#!/bin/sh\nexec {sys.executable} -m urc.cli.main "$@"\n')
        (programs / "urc").chmod(0o755)
        self.ports = {port: str(free_port()) for port in PORTS}
        self.environment = os.environ | {
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "PYTHONUNBUFFERED": "1",
            "URC_DATA_DIR": str(folder / "author"),
        }
        self.running: dict[str, subprocess.Popen[bytes]] = {}

    def own(self, text: str) -> str:
        """Return a text with ports that are free here, instead of those of the page."""
        return re.sub("|".join(PORTS), lambda found: self.ports[found[0]], text)

    def writes(self, block: Block) -> None:
        file = self.folder / block.file
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(self.own(block.text), "utf-8")

    def types(self, block: Block, answer: str) -> None:
        """Type the commands of a block, and compare what they print with what the page shows."""
        said = "".join(self._one(self.own(line), self.own(answer)) for line in block.commands)
        if answer:
            _compare(said, self.own(answer), str(block))

    def _one(self, command: str, answer: str) -> str:
        if command.startswith("export "):
            name, _, value = command.removeprefix("export ").partition("=")
            self.environment[name] = value
            return ""
        if found := LASTING.match(command):
            return self._start(found[1], command, answer)
        done = subprocess.run(
            ["bash", "-c", command], cwd=self.folder, env=self.environment, timeout=TIMEOUT_S,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{command}: {done.stdout}"
        return done.stdout

    def _start(self, name: str, command: str, answer: str) -> str:
        """Start what is left running; it is ready when it has said the last line of the page."""
        log = self.folder / f"{name.replace(' ', '-')}.log"
        with open(log, "wb") as output:
            self.running[name] = subprocess.Popen(
                ["bash", "-c", f"exec {command}"], cwd=self.folder, env=self.environment,
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            )  # fmt: skip
        last = _pattern(answer.splitlines()[-1])
        deadline = time.monotonic() + TIMEOUT_S
        while not any(re.fullmatch(last, line) for line in _lines(log)):
            assert self.running[name].poll() is None, log.read_text("utf-8")
            assert time.monotonic() < deadline, log.read_text("utf-8")
            time.sleep(0.05)
        for line in _lines(log):
            learn(line)
        return log.read_text("utf-8")

    def ends(self, name: str) -> None:
        process = self.running.pop(name)
        process.kill()
        process.wait(TIMEOUT_S)


def _lines(log: Path) -> list[str]:
    """Return the lines that are whole."""
    return log.read_text("utf-8").split("\n")[:-1]


def _pattern(shown: str) -> str:
    """Return a pattern for a line of the page."""
    return re.escape(shown).replace("…", ".*")


def _compare(said: str, answer: str, where: str) -> None:
    """See to it that every line is one of those shown, and that each of those came."""
    shown = [_pattern(line) for line in answer.splitlines()]
    lines = said.splitlines()
    unknown = [line for line in lines if not any(re.fullmatch(one, line) for one in shown)]
    missing = [one for one in shown if not any(re.fullmatch(one, line) for line in lines)]
    assert (unknown, missing) == ([], []), where


@pytest.fixture
def reader(tmp_path: Path) -> Iterator[Reader]:
    made = Reader(tmp_path)
    yield made
    for name in [*made.running]:
        made.ends(name)


async def test_the_tutorial_does_what_it_says(reader: Reader, new_page: PageMaker) -> None:
    """From an empty folder to the battery in somebody else's browser, without the repository."""
    page_blocks = blocks(TUTORIAL)
    assert sum(bool(block.file) for block in page_blocks) >= 11
    for block, following in pairwise([*page_blocks, page_blocks[-1]]):
        if block.file:
            reader.writes(block)
        elif block.language == "sh":
            if block.text.startswith("urc serve "):
                reader.ends("repo serve")  # the page says that it may be switched off
            answer = following.text if following.language == "text" else ""
            await asyncio.to_thread(reader.types, block, answer)
    assert set(reader.running) == {"simulate", "serve"}
    page = await new_page()
    await page.goto(f"http://127.0.0.1:{reader.ports['8080']}/")
    assert "My puppet" in await page.inner_text("main")
    await page.goto(f"http://127.0.0.1:{reader.ports['8080']}/robots/my-puppet/")
    first = await _level(page, "")
    assert await _level(page, first) != first
    box = await page.locator("[data-cell]").bounding_box()
    size = page.viewport_size
    assert box is not None
    assert size is not None
    assert box["x"] + box["width"] > size["width"] * 0.9
    assert box["y"] + box["height"] > size["height"] * 0.9
    assert box["x"] > size["width"] / 5


async def _level(page: Page, before: str) -> str:
    """Return what the battery shows, once that is a number, and another one than before."""
    deadline = time.monotonic() + TIMEOUT_S
    shown = ""
    while time.monotonic() < deadline:
        for frame in page.frames:  # a widget of others lives in a frame of its own
            found = frame.locator(".battery-svg-number")
            if await found.count():
                shown = await found.inner_text()
        if re.fullmatch(r"\d+ %", shown) and shown != before:
            return shown
        await asyncio.sleep(0.1)
    raise AssertionError(f"the battery shows {shown!r}")
