"""JPEG images of a video: as many as a page needs, each with the time of its access unit."""

import asyncio
import io
from itertools import pairwise

import av
import pytest
from PIL import Image

from tests.unit.test_video import encoded
from urc.runtime.still_maker import StillMaker
from urc.runtime.still_process import EVERY_S, WIDEST, Still, stills
from urc.video import VideoUnit, encode_unit

pytestmark = pytest.mark.anyio

WAIT_S = 30.0


def film(
    width: int = 320, height: int = 240, count: int = 30, codec: str = "libx264"
) -> list[VideoUnit]:
    """Return a grey film with 30 images a second, and a keyframe at every second image."""
    name = "hev1.1.6.L93.B0" if codec == "libx265" else "avc1.42E01E"
    options = {"preset": "ultrafast", "tune": "zerolatency"}
    if codec == "libx265":
        options["x265-params"] = "log-level=none"
    units = encoded(codec, width, height, count, **options)
    return [
        VideoUnit(name, place % 2 == 0, width, height, 100.0 + place / 30, data)
        for place, data in enumerate(units)
    ]


def opened(image: bytes) -> Image.Image:
    picture = Image.open(io.BytesIO(image))
    picture.load()
    return picture


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_at_most_ten_images_a_second_with_their_times(codec: str) -> None:
    units = film(codec=codec)
    made = list(stills(iter(units)))
    assert 8 <= len(made) <= 11
    times = [one.time_s for one in made]
    assert all(later - earlier >= EVERY_S * 0.9 for earlier, later in pairwise(times))
    for _, image, is_repeated in made:
        assert not is_repeated
        assert opened(image).format == "JPEG"
        assert opened(image).size == (320, 240)


def test_a_large_image_is_scaled() -> None:
    image = next(stills(iter(film(1920, 1080, 2)))).image
    assert opened(image).size == (WIDEST, 720)


def test_damage_costs_images_until_the_next_keyframe() -> None:
    """A lost or changed access unit must not end the process."""
    units = film(count=10)
    units[0] = units[0]._replace(data=b"\0\0\0\1\x65" + bytes(range(200)))
    assert len(list(stills(iter(units)))) >= 2


def test_a_gigantic_image_is_not_decoded() -> None:
    """The header of a value may lie; the decoder itself has the limit."""
    large = encoded("libx264", 8192, 4096, 1, preset="ultrafast")
    units = [VideoUnit("avc1.42E01E", True, 64, 64, 1.0, data) for data in large]
    assert list(stills(iter(units))) == []


async def test_the_process_makes_images_and_ends_with_the_maker() -> None:
    made: list[tuple[str, Still]] = []
    maker = StillMaker("eye", lambda *one: made.append(one), frozen_after_s=2.5)
    maker.start()
    async with asyncio.timeout(WAIT_S):
        while not made:
            for unit in film(count=4):
                maker.take(encode_unit(unit), is_key=unit.is_key)
            await asyncio.sleep(0.1)
    name, still = made[0]
    assert (name, opened(still.image).size) == ("eye", (320, 240))
    assert 100.0 <= still.time_s < 101.0
    process = maker._process
    assert process is not None
    await maker.stop()
    assert process.returncode is not None


async def test_a_killed_process_is_started_again() -> None:
    made: list[float] = []
    maker = StillMaker("eye", lambda _name, still: made.append(still.time_s))
    maker.start()
    try:
        for _ in range(2):
            made.clear()
            async with asyncio.timeout(WAIT_S):
                while not made:
                    for unit in film(count=4):
                        maker.take(encode_unit(unit), is_key=unit.is_key)
                    await asyncio.sleep(0.1)
            if maker._process is not None:
                maker._process.kill()
    finally:
        await maker.stop()


def test_pyav_has_the_decoders() -> None:
    """The wheels may be built anew without them."""
    assert {"h264", "hevc", "mjpeg"} <= av.codecs_available
