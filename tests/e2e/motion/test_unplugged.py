"""A serial port that is pulled out while something is held, and put in again."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from tests.e2e.transports.programs import listens, program
from urc.config.load import load_profile
from urc.model.payload import Payload
from urc.motion.hold_to_run import HoldTerms
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

pytestmark = [pytest.mark.anyio, pytest.mark.needs("socat")]

WAIT_S = 20.0
AWAY_S = 1.5
QUIET_S = 1.5
DOCUMENT = """\
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: serial
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
    reconnect: { initial: 100ms, max: 300ms }
    stale_after: 60s
commands:
  drive:
    send: "V {{ v }}"
    args: { v: { type: integer, min: -99, max: 99, default: 0 } }
    hold: { repeat: 50ms, release: {}, watchdog: none }
"""


@asynccontextmanager
async def plugged(port: Path, heard: Path) -> AsyncIterator[None]:
    """Let there be a port with a robot behind it, which writes down what it hears."""
    async with program("socat", "-u", f"PTY,raw,echo=0,link={port}", f"OPEN:{heard},creat,append"):
        await listens(port)
        yield
    port.unlink(missing_ok=True)


async def until(is_so: Callable[[], object]) -> None:
    """Wait until something is so."""
    ends_s = time.monotonic() + WAIT_S
    while not is_so():
        assert time.monotonic() < ends_s, "it never was so"
        await asyncio.sleep(0.02)


def words(heard: Path) -> list[str]:
    """Return what a robot has heard, line by line."""
    return heard.read_text("ascii").splitlines() if heard.exists() else []


async def hold(session: Session) -> None:
    """Hold the control as a hand does that notices nothing, for ever."""
    assert session.backend is not None
    while True:
        with suppress(UrcError):
            session.backend.tick("drive", session.frames.motion_frame("drive", {"v": 7}, 0.0))
        await asyncio.sleep(0.05)


def arm(session: Session) -> None:
    """Begin a gesture."""
    assert session.backend is not None
    stop = session.frames.stop_frame("drive")
    assert isinstance(stop, Payload)
    session.backend.arm("drive", HoldTerms(stop, period_s=0.05, is_lossy=True))


async def test_port_that_comes_back_hears_the_stop_first_and_nothing_moves_by_itself(
    tmp_path: Path,
) -> None:
    port, document = tmp_path / "port", tmp_path / "cart.yaml"
    before, after = tmp_path / "before", tmp_path / "after"
    document.write_text(DOCUMENT.replace("PORT", str(port)), "utf-8")
    profile, transports = load_profile(document, built_in_catalog()), built_in_catalog().transports
    async with Session(profile, {}, transports, motion="guarded") as session:
        backend = session.backend
        assert backend is not None
        async with plugged(port, before):
            await until(lambda: session.frames.is_ready("drive"))
            arm(session)
            holding = asyncio.create_task(hold(session))
            await until(lambda: words(before).count("V 7") > 5)
        await asyncio.sleep(AWAY_S)
        async with plugged(port, after):
            await until(lambda: words(after))
            assert words(after)[0] == "V 0", "the stop is the first word"
            await until(lambda: session.frames.is_ready("drive"))
            await asyncio.sleep(QUIET_S)
            assert set(words(after)) == {"V 0"}, "the hand still holds, and nothing moves"
            arm(session)
            await until(lambda: "V 7" in words(after))
            holding.cancel()
