"""The quality of a video on a page: it falls if a page is behind, and rises after a calm time."""

import pytest

from urc.web.feed.video_quality import (
    AGAIN_S,
    BEGIN_S,
    CALM_S,
    LATE_S,
    LONGEST_CALM_S,
    STALL_S,
    STEADY_S,
    TRY_S,
    VideoQuality,
)

LATE = LATE_S + 0.01


def took(quality: VideoQuality, now_s: float, lag_s: float = 0.0, *, is_skip: bool = False) -> bool:
    """Let an image begin to leave `lag_s` after its arrival."""
    return quality.takes(now_s - lag_s, now_s, is_skip=is_skip)


def made(*, has_low: bool = False) -> VideoQuality:
    """Return the quality of a page that has caught up at the time 1."""
    quality = VideoQuality(0.0, has_low=has_low)
    assert took(quality, 1.0)
    return quality


def fall(quality: VideoQuality, now_s: float) -> None:
    """Let the line be too slow until a time."""
    for at_s in (now_s - STALL_S, now_s):
        if not took(quality, at_s, LATE):
            return
    assert quality.level == "keyframes"


def test_a_page_that_cannot_catch_up_falls() -> None:
    quality = made(has_low=True)
    assert took(quality, 2.0, LATE_S - 0.02)
    assert took(quality, 3.0, LATE)
    assert took(quality, 3.0 + STALL_S - 0.01, LATE)
    assert not took(quality, 3.0 + STALL_S, LATE)
    assert quality.level == "low"
    assert took(quality, 4.0)
    fall(quality, 20.0)
    assert quality.level == "keyframes"
    assert took(quality, 21.0, 10.0), "there is no lower level"


def test_a_single_stall_lowers_nothing_and_a_second_one_does() -> None:
    """As a wireless line, or a computer that was busy for a moment."""
    quality = made()
    for at_s in (2.0, 2.0 + AGAIN_S + 0.1):
        assert took(quality, at_s, 1.0)
        assert took(quality, at_s + 0.2, 0.5)
        assert took(quality, at_s + 0.3, 0.05), "it has caught up"
    assert not took(quality, 3.0 + AGAIN_S, LATE)
    assert quality.level == "keyframes"


def test_skipped_images_are_as_bad_as_late_ones() -> None:
    """With short groups, the page is never late: it leaves out the end of each group."""
    quality = made()
    assert took(quality, 2.0, is_skip=True)
    assert took(quality, 2.1)
    assert not took(quality, 3.0, is_skip=True)


def test_a_page_that_begins_in_the_middle_of_a_group_may_catch_up() -> None:
    quality = VideoQuality(100.0, has_low=False)
    assert quality.takes(91.0, 100.0, is_skip=False)
    assert quality.takes(92.0, 102.0, is_skip=False)
    assert not quality.takes(93.0, 100.0 + BEGIN_S, is_skip=False)


def test_the_quality_rises_after_a_calm_time() -> None:
    quality = made()
    fall(quality, 2.0)
    assert not quality.rises(0, 0, 2.0 + CALM_S - 0.1)
    assert quality.rises(0, 0, 2.0 + CALM_S)
    assert quality.level == "all"
    assert not quality.rises(0, 0, 1000.0), "there is no higher level"


def test_a_late_image_ends_the_calm() -> None:
    quality = made()
    fall(quality, 2.0)
    took(quality, 10.0)
    took(quality, 11.0, LATE)
    assert not quality.rises(0, 0, 2.0 + CALM_S)
    assert quality.rises(0, 0, 11.0 + CALM_S)


def test_each_vain_attempt_doubles_the_calm_time() -> None:
    quality, now_s, calm_s = made(), 2.0, CALM_S
    for _ in range(8):
        fall(quality, now_s)
        assert not quality.rises(0, 0, now_s + calm_s - 0.1)
        now_s += calm_s
        assert quality.rises(0, 0, now_s)
        took(quality, now_s)
        now_s, calm_s = now_s + 5.0, min(LONGEST_CALM_S, 2 * calm_s)
    assert calm_s == LONGEST_CALM_S
    now_s += STEADY_S
    fall(quality, now_s)
    assert quality.rises(0, 0, now_s + CALM_S), "the level was borne for a while"


@pytest.mark.parametrize(("rate", "waits_s"), [(0, CALM_S), (130, CALM_S), (110, TRY_S)])
def test_a_line_that_seemed_too_slow_is_tried_later(rate: float, waits_s: float) -> None:
    """The videos need 100 bytes a second."""
    quality = made()
    fall(quality, 2.0)
    assert not quality.rises(rate, 100, 2.0 + waits_s - 0.1)
    assert quality.rises(rate, 100, 2.0 + waits_s)
