"""Videos in Firefox and WebKit: the right picture, also after a new start, and the driving lock."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from tests.e2e.browsers.test_other_browsers import BROWSERS, DESKTOP
from tests.e2e.browsers.video_scene import video_scene
from tests.e2e.browsers.window import Window

pytestmark = pytest.mark.needs("ffmpeg")


@pytest.mark.cases(1)  # each takes ten seconds
@pytest.mark.parametrize("opened", BROWSERS)
def test_a_video_shows_the_present_and_locks_driving(
    opened: Callable[[], AbstractContextManager[Window]], tmp_path: Path
) -> None:
    """In each browser by its own way: its decoder for H.264, or JPEG images of the server."""
    with opened() as window:
        window.resize(*DESKTOP)
        with video_scene(window, tmp_path) as scene:
            scene.sees_the_present()
            scene.is_locked_by_a_freeze()
            scene.restarts_film()
            scene.sees_the_present()
        assert window.faults() == []
