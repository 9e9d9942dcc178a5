"""The page of a robot in Firefox and WebKit: live, driven, let go, stopped, killed and back."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from tests.e2e.browsers.firefox import firefox_window
from tests.e2e.browsers.rover import Rover
from tests.e2e.browsers.scene import LEASE_S, NARROW, Scene
from tests.e2e.browsers.webkit import webkit_window

DESKTOP = (1280, 800)
NARROWEST = {"Firefox": 390, "WebKit": 447}
"""WebKit's window cannot be narrower than the buttons of its own bar."""

BROWSERS = [
    pytest.param(
        firefox_window,
        id="firefox",
        marks=[pytest.mark.needs(name) for name in ("firefox", "node", "puppeteer")],
    ),
    pytest.param(
        webkit_window,
        id="webkit",
        marks=[pytest.mark.needs(name) for name in ("webkit-driver", "xvfb")],
    ),
]


@pytest.fixture(scope="module", params=BROWSERS)
def opened(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Scene]:
    """Open the rover's page in one browser for all tests of the module."""
    folder = tmp_path_factory.mktemp("rover")
    with (
        request.param() as window,
        Rover() as rover,
        closing(Scene(window, rover, folder)) as scene,
    ):
        window.resize(*DESKTOP)
        scene.open()
        yield scene


@pytest.fixture
def scene(opened: Scene) -> Iterator[Scene]:
    """Return the scene; the test fails on errors in the console."""
    before = len(opened.window.faults())
    yield opened
    assert opened.window.faults()[before:] == []


def test_a_page_is_live_with_pictures_and_values(scene: Scene) -> None:
    scene.sees_pictures_and_values()


def test_a_held_stick_drives_and_letting_go_stops(scene: Scene) -> None:
    """The stop comes of the release, earlier than the end of the lease."""
    assert scene.drives() < LEASE_S


def test_stop_latches_and_reset_frees(scene: Scene) -> None:
    scene.stops_and_resets()


def test_each_theme_colours_the_page(scene: Scene) -> None:
    scene.shows_each_theme()


def test_the_narrowest_page_does_not_scroll_sideways(scene: Scene) -> None:
    width, _ = scene.fits(*NARROW)
    assert width == NARROWEST[scene.window.name]
    assert scene.drives() < LEASE_S
    scene.fits(*DESKTOP)


def test_a_killed_server_is_lost_and_the_new_one_live(opened: Scene) -> None:
    """The console may say that the socket failed, which is true."""
    opened.is_lost_and_back()
