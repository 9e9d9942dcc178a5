"""A recorded video: found without a page, played in step, and exported as an MP4 file.

ffmpeg films a test card with a stamp, the number of the image. The stamp shows which image it is.
"""

import asyncio
import json
import shutil
import subprocess
from base64 import b64decode
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
import pytest
from playwright.async_api import expect

from tests.e2e.command_line import run
from tests.e2e.conftest import PageMaker
from tests.e2e.foxglove_viewer import Viewer
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.test_video_page import BITS, H264, PROFILE, RATE, card, test_card
from tests.e2e.transports.programs import program
from urc.runtime.recording.reader import Recording, open_recording
from urc.runtime.recording.videos import recorded_unit

pytestmark = [pytest.mark.anyio, pytest.mark.needs("ffmpeg")]

Start = Callable[..., UrcProcess]
TOPIC: Final = "/signals/picture"


def stamp_of(frame: av.VideoFrame) -> int:
    """Return the number of an image of the card."""
    grey = frame.to_ndarray(format="gray")
    return sum(int(grey[40, 16 + 32 * bit] > 128) << bit for bit in range(BITS))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of some seconds, made without any page."""
    folder = tmp_path_factory.mktemp("recorded")
    return asyncio.run(_recorded(folder))


async def _recorded(folder: Path) -> Path:
    port, file = free_port(), folder / "eye.yaml"
    file.write_text(PROFILE.format(port=port, more=""), "utf-8")
    target = folder / "eye.mcap"
    async with program(*test_card(port, *H264)):
        done = await asyncio.to_thread(run, "record", str(file), "--for", "6s", "-o", str(target))
    assert done.returncode == 0, done.stderr
    return target


def images_before(recording: Recording, position_s: float) -> list[int]:
    """Return the stamps of the images before a position."""
    end_ns = recording.start_ns + round(position_s * 1e9)
    decoder, found = av.CodecContext.create("h264", "r"), list[int]()
    assert isinstance(decoder, av.VideoCodecContext)
    decoder.thread_count = 1
    decoder.flags |= av.codec.context.Flags.low_delay
    for message in recording.messages(0):
        unit = recorded_unit(message.data) if message.topic == TOPIC else None
        if unit is not None and message.time_ns <= end_ns:
            found += [stamp_of(frame) for frame in decoder.decode(av.Packet(unit.data))]
    return found


def test_the_film_of_a_recording_has_its_images_at_their_times(
    recording: Path, tmp_path: Path
) -> None:
    """By ffprobe and by PyAV."""
    target = tmp_path / "film.mp4"
    done = run("export", str(recording), "picture", "-o", str(target))
    assert done.returncode == 0, done.stderr
    count = len(images_before(open_recording(recording), 1e6))
    assert count > 3 * RATE, "the recording alone kept the camera open"
    assert done.stdout.startswith(f"{target}: {count} images of ")
    probed = subprocess.run(
        ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(target)],
        check=True, capture_output=True,
    )  # fmt: skip
    (stream,) = json.loads(probed.stdout)["streams"]
    assert probed.stderr == b""
    assert (stream["codec_name"], stream["width"], stream["height"]) == ("h264", 320, 240)
    assert int(stream["nb_read_frames"]) == count
    with av.open(str(target)) as container:
        frames = list(container.decode(video=0))
    stamps = np.unwrap([stamp_of(one) for one in frames], period=2**BITS)
    times = [float(one.pts * one.time_base) for one in frames]
    assert np.all(np.diff(stamps) == 1)
    rate = np.polyfit(times, stamps, 1)[0]
    assert rate == pytest.approx(RATE, rel=0.1), "the times are those of the images"


def test_each_fault_of_an_export_is_one_line(recording: Path, tmp_path: Path) -> None:
    shutil.copy(recording, tmp_path / "eye.mcap")
    faults = {
        ("no.mcap", "picture"): "no.mcap cannot be read: No such file or directory",
        ("eye.mcap", "side"): "eye.mcap contains no reading of 'side'; its videos are: picture",
    }
    for words, said in faults.items():
        done = run("export", *words, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr == f"urc export: {said}\n"
    assert run("export", "eye.mcap", "picture", cwd=tmp_path).returncode == 0
    done = run("export", "eye.mcap", "picture", cwd=tmp_path)
    said = "eye-picture.mp4 exists already; select another file with --output"
    assert (done.returncode, done.stderr) == (1, f"urc export: {said}\n")


@pytest.mark.needs("chromium")
async def test_a_jump_shows_the_image_of_the_position(
    recording: Path, urc_process: Start, new_page: PageMaker
) -> None:
    """Forwards and backwards, although images are encoded as differences from earlier ones."""
    replay = urc_process("replay", str(recording), "--port", "0")
    address = (await replay.wait_for_async(r"dashboard (http\S+)"))[1]
    page = await new_page()
    await page.goto(f"{address}robots/eye/")
    await card(page, lambda seen: seen["state"] == "live")
    await page.get_by_role("button", name="Pause").click()
    await expect(page.get_by_role("button", name="Play")).to_be_visible()
    slider = page.get_by_role("slider", name="Position in the recording")
    opened = open_recording(recording)
    for share in (0.8, 0.4, 0.9, 0.5):
        position_s = round(opened.length_s * share, 1)
        wanted = images_before(opened, position_s)[-1]
        await slider.fill(str(position_s))
        seen = await card(page, lambda seen, number=wanted: seen["number"] == number)
        assert seen["state"] in ("live", "stale")
    await page.get_by_role("button", name="Play").click()
    last = images_before(opened, 1e6)[-1]
    await card(page, lambda seen: seen["number"] == last)


@pytest.mark.needs("node")
@pytest.mark.needs("ws-protocol")
def test_a_viewer_gets_the_film_from_a_keyframe_on(recording: Path, urc_process: Start) -> None:
    replay = urc_process("replay", str(recording), "--loop", "--port", "0", "--foxglove", "0")
    address = replay.wait_for(r"foxglove (ws://127\.0\.0\.1:\d+/\?token=\S+)$")[1]
    with Viewer(address, "foxglove.sdk.v1") as viewer:
        while "/eye/picture" not in viewer.channels:
            viewer.next()
        assert viewer.channels["/eye/picture"]["schemaName"] == "foxglove.CompressedVideo"
        number = viewer.subscribe("/eye/picture")
        decoder, stamps = av.CodecContext.create("h264", "r"), list[int]()
        while len(stamps) < 40:
            told: dict[str, Any] = viewer.until("message", subscription=number)["value"]
            assert told["format"] == "h264"
            found = decoder.decode(av.Packet(b64decode(told["data"])))
            stamps += [stamp_of(one) for one in found]  # type: ignore[arg-type]
        steps = np.diff(stamps)
        assert np.count_nonzero(steps == 1) >= len(steps) - 1, "at most one start of the loop"
