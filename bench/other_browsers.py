"""Checks in browsers other than Chromium: opening every shipped robot's page, and driving a rover.

Each page must be live, show all widgets, fit the narrowest screen, and apply each theme, without
console errors. Each release must stop the rover before its lease ends. A rover with a video must
show the right picture, also after a restart of the film, and must stop when the film freezes.
"""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing
from pathlib import Path

from bench.figures import tell
from bench.harness import Result
from tests.e2e.browsers.demo import ROBOTS, demo_in
from tests.e2e.browsers.rover import Rover
from tests.e2e.browsers.scene import LEASE_S, NARROW, THEMES, WIDTHS, Scene, until
from tests.e2e.browsers.video_scene import MARGIN_S, SIGHT_S, video_scene
from tests.e2e.browsers.window import Window
from tests.e2e.test_video_page import H264, H265

__all__ = ["checked"]

DESKTOP = (1280, 800)
FEW = ("absolem", "tello", "ur-e-series")
RELEASES, RELEASES_IF_FULL = 3, 20
STOPS, STOPS_IF_FULL = 1, 5
RESTARTS, RESTARTS_IF_FULL = 1, 3
FREEZES, FREEZES_IF_FULL = 1, 10
VIDEOS = (
    ("H.264", H264, ""),
    ("H.265", H265, ""),
    ("H.265, transcoded", H265, ", transcode: h264"),
    ("MPEG-4, transcoded", ("-c:v", "mpeg4", "-q:v", "3"), ", transcode: h264"),
)
"""Name of each video, ffmpeg's arguments for its codec, and more keys of the camera."""
DECODES = """typeof VideoDecoder === "function"
  ? VideoDecoder.isConfigSupported({ codec: "avc1.42E01E" }).then(({ supported }) => supported)
  : false"""
HARMLESS = ("WebGL context", "ResizeObserver loop completed")
"""A console message that contains any of these texts is harmless.

Without a graphics processor, Firefox has no WebGL. The widgets then draw in 2D or show a message.
WebKit logs a message whenever a widget receives a size change only in the next frame.
"""


def checked(
    opened: Callable[[], AbstractContextManager[Window]], *, full: bool
) -> Sequence[Result]:
    """Check all pages in one browser (without `full`, a few), and drive the rover."""
    with opened() as window, tempfile.TemporaryDirectory(prefix="urc-bench-") as folder:
        window.resize(*DESKTOP)
        faults = _pages(window, Path(folder) / "demo", ROBOTS if full else FEW)
        slowest_s, count = _driven(window, Path(folder), full=full)
        lock_s, freezes = _filmed(window, Path(folder), full=full)
    versions = {window.name: window.version}
    return [
        Result(
            name=f"{window.name}: faults of {len(ROBOTS if full else FEW)} robots' pages",
            ratio=float(len(faults)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=1,
            versions=versions,
        ),
        Result(
            name=f"{window.name}: slowest stop after a release / lease",
            ratio=round(slowest_s / LEASE_S, 3),
            goal=1.0,
            baseline_ms=LEASE_S * 1000,
            subject_ms=round(slowest_s * 1000, 1),
            spread=1.0,
            rounds=count,
            versions=versions,
        ),
        Result(
            name=f"{window.name}: slowest stop after a freeze of the video / bound",
            ratio=round(lock_s / (SIGHT_S + MARGIN_S), 3),
            goal=1.0,
            baseline_ms=1000 * (SIGHT_S + MARGIN_S),
            subject_ms=round(1000 * lock_s, 1),
            spread=1.0,
            rounds=freezes,
            versions=versions,
        ),
    ]


def _pages(window: Window, data: Path, robots: Sequence[str]) -> list[str]:
    faults: list[str] = []
    data.mkdir()
    with demo_in(window, data) as demo:
        for robot in robots:
            before = len(window.faults())
            try:
                demo.open(robot)
                _fits(window)
                _follows_themes(window)
            except AssertionError as error:
                faults.append(f"{robot}: {error}")
            told = window.faults()[before:]
            faults += [f"{robot}: {one}" for one in told if not _is_harmless(one)]
    for fault in faults:
        tell({"browser": window.name, "fault": fault})
    return faults


def _is_harmless(fault: str) -> bool:
    return any(part in fault for part in HARMLESS)


def _fits(window: Window) -> None:
    size = window.resize(*NARROW)
    until(lambda: window.evaluate("innerWidth") == size[0], f"{size[0]} px wide")
    content, shown = window.evaluate(WIDTHS)
    assert content <= shown, f"{content} px wide on a screen of {shown} px"
    window.resize(*DESKTOP)


def _follows_themes(window: Window) -> None:
    grounds = set()
    for theme in THEMES:
        window.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
        grounds.add(window.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert len(grounds) == len(THEMES), f"themes share their background colour: {sorted(grounds)}"


def _driven(window: Window, folder: Path, *, full: bool) -> tuple[float, int]:
    """Return the slowest stop after a release, in seconds, and the number of releases."""
    releases = RELEASES_IF_FULL if full else RELEASES
    with Rover() as rover, closing(Scene(window, rover, folder)) as scene:
        scene.open()
        scene.sees_pictures_and_values()
        slowest_s = max(scene.drives() for _ in range(releases))
        for _ in range(STOPS_IF_FULL if full else STOPS):
            scene.stops_and_resets()
        for _ in range(RESTARTS_IF_FULL if full else RESTARTS):
            scene.is_lost_and_back()
    return slowest_s, releases


def _filmed(window: Window, folder: Path, *, full: bool) -> tuple[float, int]:
    """Return the slowest stop after a freeze of the video, in seconds, and the number of freezes.

    Each picture is read back from screenshots, before and after a restart of the film.
    """
    freezes, slowest_s, count = FREEZES_IF_FULL if full else FREEZES, 0.0, 0
    for number, (name, codec, more) in enumerate(VIDEOS if full else VIDEOS[:1]):
        place = folder / f"video{number}"
        place.mkdir()
        with video_scene(window, place, codec, more) as scene:
            scene.sees_the_present()
            decodes = window.evaluate(DECODES)
            for _ in range(freezes):
                slowest_s = max(slowest_s, scene.is_locked_by_a_freeze())
                count += 1
            scene.restarts_film()
            scene.sees_the_present()
        tell({"browser": window.name, "video": name, "decodes H.264": decodes, "right": True})
    return slowest_s, count
