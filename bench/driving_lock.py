"""Time from the declared age of an image until the robot stops, and false stops by jitter.

A real Chromium drives a robot that declares `stop_after`. The image then stands still, in each of
the ways that the tests of the driving lock know. Each time is measured from the moment at which the
image has the declared age until the stop is written. An encoder may also encode a standing picture
again and again. Some keyframes then have to repeat before the page notices it. In further trials,
the process of the server or of the page is frozen.

In the trials of jitter, images arrive every 30 ± 25 ms, and 1 % of them are lost. A stop or a lower
speed is then false. A trial is repeated if the machine held up the server's event loop for longer
than the excess. An interrupted run can be resumed.
"""

import asyncio
import os
import random
import signal
import tempfile
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Final, NamedTuple

from playwright.async_api import Page

from bench.driving_lock_pages import separate_cart
from bench.figures import distribution, tell
from bench.harness import Result
from bench.kept import Kept
from tests.e2e.browser import running_browser
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.motion.driving import push_until
from tests.e2e.motion.test_driving_lock import (
    MARGIN_S,
    SIGHT,
    STICK,
    STUCK,
    VIDEO_STOP_S,
    Seeing,
    filmed,
    filmed_cart,
    moves,
)
from tests.e2e.motion.test_standing_video import projected_cart
from tests.films import GROUP, RATE

__all__ = ["measured", "run"]

EACH, EACH_IF_FULL = 5, 200
JITTER_S, JITTER_S_IF_FULL = 20, 600
PIECE_S: Final = 20
"""Time of one trial of jitter, in seconds."""
ROUND: Final = 20
"""Number of trials with the same server."""
ROUND_OF_VIDEOS: Final = {"video": 6, "standing": 3, "server": 10, "background": 10}
"""Number of trials with the same cart."""
MOST_TIMES: Final = 3
"""Maximum number of trials, as a multiple of the required number, if trials are invalid."""
BOUND_MS: Final = 1000 * MARGIN_S
PERIOD_S, SPREAD_S, LOSS = 0.030, 0.025, 0.01
FROZEN_AFTER_S: Final = 1.0
ENDED_S: Final = 3 * GROUP / RATE
"""Time after which the page takes a moving picture for current again, in seconds."""
PUSHED_S: Final = 0.4
"""Time for which the robot moves before the image stands still, in seconds."""
KINDS: Final = (
    *("camera", "decoder", "repetition", "video", "server", "background"),
    "standing",
)
KEYFRAMES: Final = 6
"""Number of keyframes after which the page must have found a standing picture of x264."""
BOUNDS_MS: Final = {
    **dict.fromkeys(KINDS, BOUND_MS),
    "standing": BOUND_MS + 1000 * KEYFRAMES * GROUP / RATE,
}
"""Longest permitted time from the declared age until the stop, in milliseconds."""
JITTER: Final = "jitter"


class Trial(NamedTuple):
    """One trial, as stored."""

    kind: str
    late_ms: float = 0.0
    """Time from the declared age until the stop, in milliseconds."""
    held_up_ms: float = 0.0
    """Longest time for which the machine held up the event loop during the trial."""
    stops: int = 0
    """Number of false stops during jitter."""
    slower: int = 0
    """Number of frames with a false lower speed during jitter."""
    images: int = 0
    lost: int = 0

    @property
    def is_excused(self) -> bool:
        """Whether the machine's delay makes the trial invalid."""
        if self.kind == JITTER:
            slow_ms = 1000 * (SIGHT.slow_after_s or 0.0)
            return bool(self.stops or self.slower) and self.held_up_ms > slow_ms / 2
        return 0 < self.late_ms - BOUNDS_MS[self.kind] <= self.held_up_ms


class Jittery(Seeing):
    """A robot whose images arrive at irregular times, and are sometimes lost."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = random.Random(seed)  # noqa: S311 - a network, no secret
        self.images = self.lost = 0

    def wait_s(self) -> float:
        """Return the time until the next image, in seconds."""
        return PERIOD_S + self._random.uniform(-SPREAD_S, SPREAD_S)

    def is_lost(self) -> bool:
        """Return whether the network loses the next image."""
        self.images += 1
        is_lost = self._random.random() < LOSS
        self.lost += is_lost
        return is_lost


class Witness:
    """Measures for how long the machine holds up the event loop."""

    def __init__(self) -> None:
        self.worst_ms = 0.0

    def begin(self) -> None:
        """Forget the earlier delays."""
        self.worst_ms = 0.0

    async def watch(self) -> None:
        """Measure until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            due_s = loop.time() + 0.005
            await asyncio.sleep(0.005)
            self.worst_ms = max(self.worst_ms, 1000 * (loop.time() - due_s))


def run(*, full: bool) -> Sequence[Result]:
    """Make the trials of all kinds; compare the slowest stop with the limit."""
    each, jitter_s = (EACH_IF_FULL, JITTER_S_IF_FULL) if full else (EACH, JITTER_S)
    return measured(each, jitter_s)


def measured(each: int, jitter_s: int) -> list[Result]:
    """Make `each` trials of each kind, and `jitter_s` seconds of jitter."""
    kept = Kept(f"driving_lock-{each}-{jitter_s}")
    wanted = {**dict.fromkeys(KINDS, each), JITTER: -(-jitter_s // PIECE_S)}
    for kind, count in wanted.items():
        while (left := count - len(_valid(kept.rows, kind))) > 0:
            made = len(_all(kept.rows, kind))
            if made >= MOST_TIMES * count:
                break  # the machine is too busy
            most = ROUND_OF_VIDEOS.get(kind, ROUND)
            asyncio.run(_round(kind, min(most, left), kept, seed=made))
    rows = kept.end()
    results = [_told(kind, _all(rows, kind), each) for kind in KINDS]
    return [*results, _told_jitter(_all(rows, JITTER), wanted[JITTER])]


def _all(rows: Sequence[Mapping[str, object]], kind: str) -> list[Trial]:
    return [Trial(**row) for row in rows if row["kind"] == kind]  # type: ignore[arg-type]


def _valid(rows: Sequence[Mapping[str, object]], kind: str) -> list[Trial]:
    return [one for one in _all(rows, kind) if not one.is_excused]


async def _round(kind: str, count: int, kept: Kept, *, seed: int) -> None:
    """Make up to `count` trials of one kind, and store each as soon as it is over."""
    witness = Witness()
    watching = asyncio.create_task(witness.watch())
    try:
        async with running_browser() as browser:
            maker = PageMaker(browser)
            try:
                trials = _TRIALS[kind](maker, count, witness, seed)
                async for trial in trials:
                    kept.add(trial._asdict())
            finally:
                await maker.close()
    finally:
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching


async def _cameras(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """The camera sends no more images."""
    async with filmed(maker) as (robot, page):
        for _ in range(count):
            await _moving(robot, page, witness)
            robot.is_filming = False
            at_s = await robot.until_stopped()
            yield _trial("camera", at_s - robot.seen_s, witness)
            robot.is_filming = True
            await page.mouse.up()
            await asyncio.sleep(0.2)


async def _decoders(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """The page receives images, and shows none of them."""
    async with filmed(maker) as (robot, page):
        for _ in range(count):
            await page.evaluate(STUCK)
            await _moving(robot, page, witness)
            began_s = robot.clock.now()
            await page.evaluate("globalThis.isStuck = true")
            at_s = await robot.until_stopped()
            yield _trial("decoder", at_s - began_s, witness)
            await page.mouse.up()
            await page.reload()
            await page.wait_for_function(
                "() => document.querySelector('.camera canvas')?.width === 64"
            )


async def _repetitions(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """The camera sends its last image again and again."""
    async with filmed(maker, frozen_after_s=FROZEN_AFTER_S) as (robot, page):
        for _ in range(count):
            await _moving(robot, page, witness)
            robot.is_repeating = True
            at_s = await robot.until_stopped()
            yield _trial("repetition", at_s - robot.seen_s, witness)
            robot.is_repeating = False
            await page.mouse.up()
            await asyncio.sleep(0.2)


async def _videos(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """The program that sends the video of a robot with a guard is frozen."""
    loop = asyncio.get_running_loop()
    with tempfile.TemporaryDirectory() as folder:
        async with filmed_cart(maker, Path(folder)) as (cart, page, ffmpeg):
            for _ in range(count):
                await push_until(lambda: moves(cart), page, ".joystick-pad")
                await asyncio.sleep(PUSHED_S)
                witness.begin()
                os.kill(ffmpeg.pid, signal.SIGSTOP)
                began_s = loop.time()
                await until(lambda: not moves(cart))
                yield _trial("video", loop.time() - began_s, witness, VIDEO_STOP_S)
                os.kill(ffmpeg.pid, signal.SIGCONT)
                await page.mouse.up()
                await asyncio.sleep(1.0)  # what waited in ffmpeg comes in a burst


async def _standing(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """The encoder of a robot with a guard gets the same picture again and again."""
    loop = asyncio.get_running_loop()
    with tempfile.TemporaryDirectory() as folder:
        async with projected_cart(maker, Path(folder)) as (cart, page, projector):
            for _ in range(count):
                await push_until(lambda: moves(cart), page, ".joystick-pad")
                await asyncio.sleep(PUSHED_S)
                witness.begin()
                projector.kind = "standing"
                began_s = loop.time()
                await until(lambda: not moves(cart))
                yield _trial("standing", loop.time() - began_s, witness, VIDEO_STOP_S)
                projector.kind = "moving"
                await page.mouse.up()
                await asyncio.sleep(ENDED_S)


def _whole(kind: str) -> Callable[[PageMaker, int, Witness, int], AsyncIterator[Trial]]:
    """Return the trials in which the whole server or the whole page stands still."""

    async def trials(
        maker: PageMaker, count: int, witness: Witness, seed: int
    ) -> AsyncIterator[Trial]:
        loop = asyncio.get_running_loop()
        with tempfile.TemporaryDirectory() as folder:
            async with separate_cart(maker, Path(folder)) as stage:
                for _ in range(count):
                    await stage.drive()
                    await asyncio.sleep(PUSHED_S)
                    witness.begin()
                    began_s = loop.time()
                    await stage.stand(kind)
                    try:
                        await stage.until_stopped()
                        took_s = loop.time() - began_s
                    finally:
                        await stage.go_on(kind)
                    yield _trial(kind, took_s, witness, VIDEO_STOP_S)

    return trials


async def _jitters(
    maker: PageMaker, count: int, witness: Witness, seed: int
) -> AsyncIterator[Trial]:
    """All is well, but images arrive at irregular times."""
    jittery = Jittery(seed)
    async with filmed(maker, seeing=jittery) as (robot, page):
        for _ in range(count):
            await _moving(robot, page, witness)
            written, images, lost = len(robot.line.texts), jittery.images, jittery.lost
            full = robot.speeds_since(0)[-1]
            await asyncio.sleep(PIECE_S)
            texts = robot.line.texts[written:]
            slower = sum(one < full for one in robot.speeds_since(written))
            yield Trial(
                JITTER,
                held_up_ms=round(witness.worst_ms, 1),
                stops=sum(one.endswith("stop") for one in texts),
                slower=slower,
                images=jittery.images - images,
                lost=jittery.lost - lost,
            )
            await page.mouse.up()
            await robot.until_stopped()


_TRIALS: Final = {
    "camera": _cameras,
    "decoder": _decoders,
    "repetition": _repetitions,
    "video": _videos,
    "standing": _standing,
    "server": _whole("server"),
    "background": _whole("background"),
    JITTER: _jitters,
}


async def _moving(robot: Seeing, page: Page, witness: Witness) -> None:
    """Drive the robot for a moment."""
    await push_until(robot.is_moving, page, STICK)
    await asyncio.sleep(PUSHED_S)
    witness.begin()


def _trial(kind: str, took_s: float, witness: Witness, stop_s: float = SIGHT.stop_after_s) -> Trial:
    late_ms = 1000 * (took_s - stop_s)
    return Trial(kind, round(late_ms, 1), round(witness.worst_ms, 1))


def _told(kind: str, trials: Sequence[Trial], each: int) -> Result:
    times_ms = [one.late_ms for one in trials if not one.is_excused]
    bound_ms = BOUNDS_MS[kind]
    spread = distribution(times_ms, bound_ms)
    spread.pop("histogram_ms", None)  # nearly all values would be in one bar
    tell(
        {
            "figure": "driving_lock",
            "what stands still": kind,
            "trials": len(times_ms),
            "broken": sum(one > bound_ms for one in times_ms),
            "excused": len(trials) - len(times_ms),
            **spread,
        }
    )
    slowest = max(times_ms) if len(times_ms) >= each else inf
    return Result(
        name=f"driving lock, {kind}: slowest of {len(times_ms)} / {bound_ms:g} ms after the age",
        ratio=round(max(slowest, 0.0) / bound_ms, 3),
        goal=1.0,
        baseline_ms=bound_ms,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(times_ms),
    )


def _told_jitter(trials: Sequence[Trial], pieces: int) -> Result:
    valid = [one for one in trials if not one.is_excused]
    stops, slower = sum(one.stops for one in valid), sum(one.slower for one in valid)
    tell(
        {
            "figure": "driving_lock_jitter",
            "seconds": PIECE_S * len(valid),
            "excused": len(trials) - len(valid),
            "images": sum(one.images for one in valid),
            "lost": sum(one.lost for one in valid),
            "false stops": stops,
            "slower frames": slower,
        }
    )
    false = stops + slower if len(valid) >= pieces else inf
    return Result(
        name=f"driving lock, jitter: false stops in {PIECE_S * len(valid)} s",
        ratio=float(false),
        goal=0.0,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=len(valid),
    )
