"""A robot behind a Zenoh router that freezes or dies while it is driven."""

import asyncio
import signal
from contextlib import suppress
from pathlib import Path

import pytest

from bench.rig.freeze import Freeze, freeze
from tests.e2e.transports.test_zenoh import device
from tests.e2e.verdict import judged
from urc.config.load import load_profile
from urc.motion.hold_to_run import HoldTerms
from urc.problems import UrcError
from urc.runtime.held_commands import restored_s
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

pytestmark = [pytest.mark.anyio, pytest.mark.alone]


async def test_nothing_old_arrives_after_a_freeze_of_the_router_and_the_stop_is_last() -> None:
    """All of it, two hundred times: `./dev bench motion_zenoh --full`."""
    freezes: list[Freeze] = []
    while not judged(freezes, 2):
        freezes += await freeze(1, robot_count=2, lasts_s=3.0, via="zenoh", seed=5 + len(freezes))


@pytest.mark.parametrize("lasts_s", [0.65, 3.0])
async def test_a_freeze_behind_throttled_ros_topics_ends_the_motion(lasts_s: float) -> None:
    """Messages that URC holds back go on for up to 2 s, and prove nothing."""
    freezes: list[Freeze] = []
    while not judged(freezes, 2):
        freezes += await freeze(
            1, robot_count=2, lasts_s=lasts_s, via="ros_zenoh", seed=7 + len(freezes)
        )


async def test_the_stop_is_first_after_the_router_was_killed() -> None:
    deaths: list[Freeze] = []
    while not judged(deaths, 2):
        deaths += await freeze(
            1, robot_count=2, lasts_s=1.0, via="zenoh", seed=9 + len(deaths), is_killed=True
        )


ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, default: 7447 }
transports:
  router: { type: zenoh, host: 127.0.0.1, port: "{{ settings.port }}" }
commands:
  go:
    args: { t: { type: integer, min: 0, default: 0 } }
    send: { publish: { topic: go, text: "M {{ t }}" } }
    hold: { repeat: 50ms, release: { t: 0 }, watchdog: none }
  light: { send: { publish: { topic: lamp/set, text: "1" } } }
"""


async def drives(session: Session) -> None:
    """Hold the control, and switch a lamp that does not exist, until cancelled."""
    assert session.backend is not None
    while True:
        with suppress(UrcError):
            session.backend.tick("go", session.frames.motion_frame("go", {"t": 7}, 0.0))
            await session.command("light", {})
        await asyncio.sleep(0.05)


@pytest.mark.parametrize(("late_s", "within_s"), [(0.0, 1.0), (2.0, 0.5)])
async def test_stop_reaches_a_device_that_comes_back_with_its_router_or_later(
    late_s: float, within_s: float, tmp_path: Path
) -> None:
    """With the usual timeouts, although a key that was just used has no subscriber."""
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    profile = load_profile(path, built_in_catalog())
    loop, table = asyncio.get_running_loop(), built_in_catalog().transports
    async with device(key="go") as other:
        settings = {"port": other.port}
        session = Session(profile, settings, table, motion="guarded")
        await session.__aenter__()
        try:
            assert session.backend is not None
            async with asyncio.timeout(20):
                while not (session.backend.is_open("go") and session.frames.is_ready("go")):  # noqa: ASYNC110
                    await asyncio.sleep(0.02)
            terms = HoldTerms(
                b"", 0.05, is_lossy=True, restored_s=restored_s(profile.driver, "router")
            )
            session.backend.arm("go", terms.stopped_by(session.frames.stop_frame("go")))
            driving = asyncio.create_task(drives(session))
            assert (await other.next("put"))["value"] == "M 7"
            await asyncio.sleep(0.5)
            other.signal(signal.SIGKILL)
            await asyncio.sleep(0.5)
            async with device(other.port, late_s=late_s, key="go") as again:
                if late_s:
                    await again.next("subscribed")
                began = loop.time()
                assert (await again.next("put"))["value"] == "M 0"
                assert loop.time() - began < within_s
            driving.cancel()
            await asyncio.gather(driving, return_exceptions=True)
        finally:
            await session.__aexit__(None, None, None)
