"""Videos whose picture stands still: found by the rule, and in the data of real encoders."""

from itertools import islice

import pytest

from tests.effort import sampled
from tests.films import RATE, FilmKind, pictures
from urc.runtime.standing_pictures import MOST_KEYFRAMES, StandingPictures
from urc.runtime.still_process import Still, stills
from urc.video import VideoUnit

AFTER_S = 1.0
SECONDS, SHORT_GROUP = 5, 5
"""A film with 30 keyframes."""
BLOCKS = 16


def blocks(quality: int, new: int = 0, seed: int = 0) -> list[int]:
    """Return a keyframe with some blocks that no other keyframe has, and a quality for all."""
    return [1000 * quality + place if place >= new else -1000 * seed - place - 1
            for place in range(BLOCKS)]  # fmt: skip


def test_a_keyframe_that_repeats_makes_the_picture_as_old_as_its_first_one() -> None:
    """Also if keyframes with another quality lie between them."""
    standing = StandingPictures(AFTER_S)
    for time_s, quality in ((0.0, 1), (0.5, 2), (1.0, 3)):
        standing.add_keyframe(blocks(quality), time_s)
        assert standing.first_s(time_s) is None
    standing.add_keyframe(blocks(2), 1.4)
    assert standing.first_s(1.4) is None, "not before the declared time"
    assert standing.first_s(1.5) == 0.5
    standing.add_keyframe(blocks(1), 2.0)
    assert standing.first_s(2.0) == 0.0


def test_an_eighth_of_the_image_may_have_a_new_quality() -> None:
    for new, is_found in ((0, True), (BLOCKS // 8, True), (BLOCKS // 8 + 1, False)):
        standing = StandingPictures(AFTER_S)
        standing.add_keyframe(blocks(1), 0.0)
        standing.add_keyframe(blocks(1, new, seed=7), 2.0)
        assert (standing.first_s(2.0) == 0.0) == is_found


def test_areas_without_noise_prove_nothing() -> None:
    """Most of the image is a white sky."""
    standing = StandingPictures(AFTER_S)
    for time in range(100):
        standing.add_keyframe(blocks(1, BLOCKS // 4, seed=time), float(time))
        assert standing.first_s(float(time)) is None


def test_two_new_keyframes_end_the_standstill() -> None:
    """One may have a new quality."""
    standing = StandingPictures(AFTER_S)
    standing.add_keyframe(blocks(1), 0.0)
    standing.add_keyframe(blocks(1), 1.0)
    standing.add_keyframe(blocks(2), 2.0)
    assert standing.first_s(2.0) == 0.0
    standing.add_keyframe(blocks(1), 3.0)
    standing.add_keyframe(blocks(3), 4.0)
    assert standing.first_s(4.0) == 0.0
    standing.add_keyframe(blocks(4), 5.0)
    assert standing.first_s(5.0) is None


def test_a_standstill_lasts_longer_than_the_memory() -> None:
    standing = StandingPictures(AFTER_S)
    for time in range(3 * MOST_KEYFRAMES):
        standing.add_keyframe(blocks(1), float(time))
    assert standing.first_s(3.0 * MOST_KEYFRAMES) == 0.0


def test_the_memory_is_limited() -> None:
    standing = StandingPictures(AFTER_S)
    for time in range(1, 3 * MOST_KEYFRAMES):
        standing.add_keyframe(blocks(time), float(time))
    assert len(standing._blocks) == MOST_KEYFRAMES * BLOCKS
    standing.add_keyframe(blocks(1), 1000.0)
    assert standing.first_s(2000.0) is None, "the oldest keyframe is forgotten"


def test_an_image_without_blocks_is_current() -> None:
    standing = StandingPictures(AFTER_S)
    for time in range(5):
        standing.add_keyframe([], float(time))
        assert standing.first_s(float(time)) is None


RATE_CONTROLS = [
    pytest.param("libx264", {}, id="x264"),
    pytest.param("libx264", {"preset": "veryfast"}, id="x264 veryfast"),
    pytest.param("libx264", {"qp": "30"}, id="x264 quantiser"),
    pytest.param(
        "libx264", {"b": "800k", "maxrate": "800k", "bufsize": "800k"}, id="x264 bit rate"
    ),
    pytest.param(
        "libx264",
        {"preset": "veryfast", "b": "2M", "maxrate": "2M", "bufsize": "1M"},
        id="x264 2 Mbit/s",
    ),
    pytest.param("libx265", {}, id="x265"),
]
"""Constant quality, constant quantiser, and constant bit rate as in IP cameras."""


def seen(kind: FilmKind, codec: str, options: dict[str, str]) -> list[Still]:
    """Return the JPEG images of a film with `SECONDS` seconds."""
    name = "hev1.1.6.L93.B0" if codec == "libx265" else "avc1.42E01E"
    units = islice(pictures(kind, codec, group=SHORT_GROUP, **options), SECONDS * RATE)
    film = (
        VideoUnit(name, is_key, 320, 240, place / RATE, data)
        for place, (is_key, data) in enumerate(units)
    )
    return list(stills(film, AFTER_S))


@pytest.mark.parametrize(("codec", "options"), sampled(RATE_CONTROLS, 2))
def test_a_standing_picture_is_found_although_it_is_encoded_anew(
    codec: str, options: dict[str, str]
) -> None:
    made = seen("standing", codec, options)
    repeated = [one for one in made if one.is_repeated]
    assert repeated, "it was found"
    assert all(one.time_s < SECONDS / 2 for one in repeated), "as old as an early image"
    assert made.index(repeated[0]) / 10 >= AFTER_S, "not before the declared time"
    assert made[-1].is_repeated


@pytest.mark.parametrize(("codec", "options"), sampled(RATE_CONTROLS, 2, "current"))
@pytest.mark.parametrize("kind", ["noisy", "moving"])
def test_a_picture_with_noise_is_current(
    kind: FilmKind, codec: str, options: dict[str, str]
) -> None:
    assert not any(one.is_repeated for one in seen(kind, codec, options))


def test_a_film_is_not_compared_without_the_key() -> None:
    units = islice(pictures("standing"), 4 * RATE)
    film = (
        VideoUnit("avc1.42E01E", is_key, 320, 240, place / RATE, data)
        for place, (is_key, data) in enumerate(units)
    )
    assert not any(one.is_repeated for one in stills(film))
