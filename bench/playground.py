"""The playground in a real Chromium, from a static web server, without access to other hosts.

The page checks every broken document of the tests. The reports must match those of `urc validate`
in line, column, severity, code and message. Then each round starts the emulated TurtleBot in a new
browser profile, and drives it. A round measures the time from the click to the first camera image.
While the stick is held, the round measures the times between the dashboard's animation frames. An
interrupted run can be continued.
"""

import asyncio
import hashlib
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from math import cos, inf, sin
from pathlib import Path
from random import Random
from typing import Any, Final

from playwright.async_api import Browser, Page

from bench.browser_page import at_share, running_browser
from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from scripts.playground import write
from tests.contract.test_broken_documents import BROKEN, DOCUMENTS
from tests.e2e.playground import OFFLINE, all_files, opened, put, served, shown_report, start

__all__ = ["run"]

Rows = Sequence[Mapping[str, Any]]

FIRST_PICTURE_MS: Final = 10_000
BETWEEN_FRAMES_MS: Final = 20
"""Longest allowed 95th percentile of the time between frames."""
SAMPLE: Final = 24
"""Number of documents that are checked without `--full`."""
AT_ONCE: Final = 8
"""Number of documents whose results are stored together."""
ROUNDS, ROUNDS_IF_FULL = 2, 7
DRIVE_S: Final = 12.0
HAND_HZ: Final = 50
LEAST_SHARE: Final = 0.5
"""Minimum share of the drive with a held stick; a busy machine ends some gestures early."""
MOST_GESTURES: Final = 30
COMMAND_TIMEOUT_S: Final = 60
PICTURE_MS: Final = 110_000
SIZE: Final = {"width": 1440, "height": 900}
CLICKED = """
() => document.querySelector("[data-go]").addEventListener(
  "click", () => { window.benchClick = performance.now(); }, { capture: true })
"""
# The canvas gets its size with its first image.
PICTURE = """
() => {
  const shown = document.querySelector("iframe")?.contentDocument;
  const isShown = Boolean(shown?.querySelector(".camera-picture")?.style.width);
  return isShown ? performance.now() - window.benchClick : false;
}
"""
RECORD = """
() => {
  const { contentWindow, contentDocument } = document.querySelector("iframe");
  window.benchBetween = [];
  let before = 0;
  const frame = (now) => {
    const isHeld = contentDocument.querySelector(".joystick").dataset.phase === "held";
    if (isHeld && before) window.benchBetween.push(now - before);
    before = isHeld ? now : 0;
    contentWindow.requestAnimationFrame(frame);
  };
  contentWindow.requestAnimationFrame(frame);
}
"""


def run(*, full: bool) -> Sequence[Result]:
    """Compare all reports and time several starts; without `full`, compare only a sample."""
    documents = DOCUMENTS if full else Random(22).sample(DOCUMENTS, SAMPLE)  # noqa: S311
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        root = Path(folder)
        version = write(root / "playground")
        kept = Kept(f"playground-{_subject(version)}-{len(documents)}")
        with served(root) as address:
            asyncio.run(_run(f"{address}playground/", documents, rounds, kept))
    return _told(kept.end())


def _subject(version: str) -> str:
    """Return an identifier for this version of the playground and of the documents."""
    total = hashlib.sha256(version.encode())
    for name, text in all_files(BROKEN).items():
        total.update(f"{name}\n{text}".encode())
    return total.hexdigest()[:12]


async def _run(address: str, documents: Sequence[str], rounds: int, kept: Kept) -> None:
    async with running_browser(is_whole=True) as browser:
        for _ in range(rounds - sum("first_picture_ms" in row for row in kept.rows)):
            kept.add(await _round(browser, address))
        done = {row.get("document") for row in kept.rows}
        left = [name for name in documents if name not in done]
        if left:
            await _compare(browser, address, left, kept)


# -- reports


async def _compare(browser: Browser, address: str, left: Sequence[str], kept: Kept) -> None:
    files = all_files(BROKEN)
    async with opened(browser, address) as page:
        for first in range(0, len(left), AT_ONCE):
            names = list(left[first : first + AT_ONCE])
            began_s = time.monotonic()
            shown, said = await asyncio.gather(
                put(page, {} if first else files, names),
                asyncio.gather(*(_command(name) for name in names)),
            )
            spent_s = (time.monotonic() - began_s) / len(names)
            for name, page_report, report in zip(names, shown, said, strict=True):
                mine, theirs = _comparable(page_report), _comparable(report)
                row = {"document": name, "same": mine == theirs, "seconds": round(spent_s, 3)}
                kept.add(row if mine == theirs else {**row, "page": mine, "command": theirs})


def _comparable(report: Mapping[str, Any]) -> list[tuple[object, ...]]:
    """Return the compared fields of each problem, or the check's output if there is no report."""
    return shown_report(dict(report)) if "problems" in report else [("no report", str(report))]


async def _command(document: str) -> dict[str, Any]:
    """Run `urc validate` in a separate process, and return its JSON report."""
    command = (sys.executable, "-m", "urc.cli.main", "validate", "--format", "json", document)
    process = await asyncio.create_subprocess_exec(
        *command, cwd=BROKEN, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        out, err = await asyncio.wait_for(process.communicate(), COMMAND_TIMEOUT_S)
    except TimeoutError:
        process.kill()
        raise SystemExit(f"bench: urc validate {document}: no report within a minute") from None
    found: dict[str, Any] = json.loads(out) if out.strip() else {"fault": err.decode()}
    return found


# -- speed


async def _round(browser: Browser, address: str) -> dict[str, object]:
    """Start the robot in a new browser profile, and drive it."""
    async with opened(browser, address) as page:
        await page.set_viewport_size(SIZE)  # type: ignore[arg-type]
        await page.evaluate(CLICKED)
        picture = asyncio.ensure_future(
            page.wait_for_function(PICTURE, polling="raf", timeout=PICTURE_MS)
        )
        await start(page)
        first_ms = await (await picture).json_value()
        # The page keeps its files for later visits, which is no part of the drive.
        await page.locator("[data-state]", has_text=OFFLINE).wait_for()
        between = sorted(await _drive(page))
    held_s = sum(between) / 1000
    if held_s < LEAST_SHARE * DRIVE_S:
        raise SystemExit(f"bench: the robot was driven for only {held_s:.1f} s of {DRIVE_S:g} s")
    return {
        "first_picture_ms": round(first_ms),
        "p50_ms": at_share(between, 0.5),
        "p95_ms": at_share(between, 0.95),
        "frames": len(between),
    }


async def _drive(page: Page) -> list[float]:
    """Hold the stick and steer in circles; return the times between frames, in milliseconds."""
    frame = page.frame_locator("iframe")
    place = frame.locator("[data-cell]").filter(has_text="Position")
    before = await place.inner_text()
    box = await frame.locator(".joystick-pad").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    radius = min(box["width"], box["height"]) / 3
    await page.evaluate(RECORD)
    end_s = time.monotonic() + DRIVE_S
    for _ in range(MOST_GESTURES):
        await page.mouse.move(x, y)
        await page.mouse.down()
        await asyncio.sleep(0.3)  # the first gesture takes the controls
        while (left_s := end_s - time.monotonic()) > 0:
            turn = 2 * left_s
            await page.mouse.move(x + radius * sin(turn), y - radius * abs(cos(turn)))
            await asyncio.sleep(1 / HAND_HZ)
            if await frame.locator(".joystick[data-phase=spent]").count():
                break
        await page.mouse.up()
        if time.monotonic() > end_s:
            break
    if await place.inner_text() == before:
        raise SystemExit("bench: the robot did not move")
    if not await frame.locator(".camera[data-state=live]").count():
        raise SystemExit("bench: the camera's images stopped during the drive")
    found: list[float] = await page.evaluate("() => window.benchBetween")
    return found


# -- results


def _told(rows: Rows) -> Sequence[Result]:
    documents = [row for row in rows if "document" in row]
    starts = [row for row in rows if "first_picture_ms" in row]
    unlike = [row for row in documents if not row["same"]]
    for row in unlike:
        print(json.dumps({"unlike": "playground", **row}, ensure_ascii=False), flush=True)
    firsts = [float(row["first_picture_ms"]) for row in starts]
    frames = [float(row["p95_ms"]) for row in starts]
    tell(
        {
            "figure": "playground",
            "documents": len(documents),
            "different reports": len(unlike),
            "first picture_ms": round(statistics.median(firsts)),
            "slowest first picture_ms": round(max(firsts)),
            "between frames, median_ms": round(
                statistics.median(float(row["p50_ms"]) for row in starts), 1
            ),
            "between frames, 95th percentile_ms": round(statistics.median(frames), 1),
        }
    )
    return [
        Result(
            name=f"playground: reports that differ from the command's, of {len(documents)}",
            ratio=float(len(unlike)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=len(documents),
        ),
        _timed("first picture after the click / 10 s", firsts, FIRST_PICTURE_MS),
        _timed("95th percentile between frames / 20 ms", frames, BETWEEN_FRAMES_MS),
    ]


def _timed(name: str, times_ms: Sequence[float], most_ms: float) -> Result:
    middle = statistics.median(times_ms) if times_ms else inf
    return Result(
        name=f"playground: {name}",
        ratio=round(middle / most_ms, 3),
        goal=1.0,
        baseline_ms=most_ms,
        subject_ms=round(middle, 1),
        spread=round(max(times_ms) / middle, 2),
        rounds=len(times_ms),
    )
