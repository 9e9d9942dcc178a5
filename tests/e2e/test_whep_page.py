"""A WebRTC camera on the page: the stamp of the WHEP server's card is read back from the page."""

import asyncio
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.test_video_page import PROFILE, assert_moves, card, is_live
from tests.e2e.transports.test_whep import front, whep_server

pytestmark = [pytest.mark.anyio]


async def served(
    folder: Path, urc_process: Callable[..., UrcProcess], port: int
) -> tuple[str, UrcProcess]:
    """Serve the profile of a WebRTC camera; return the page's address, and the server."""
    file = folder / "eye.yaml"
    profile = PROFILE.format(port=port, more="").replace(f"udp://127.0.0.1:{port}", front(port))
    file.write_text(profile, "utf-8")
    server = urc_process("serve", str(file), "--port", "0", "--data-dir", str(folder / "data"))
    found = await server.wait_for_async(r"(http://\S+)")
    return f"{found[1]}robots/eye/", server


async def test_the_stamp_is_read_back_also_after_the_servers_return(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """A lost server makes the image frozen, then stale; the next one makes it live by itself."""
    port = free_port()
    address, _ = await served(tmp_path, urc_process, port)
    page = await new_page()
    async with whep_server(port=port) as (_, process):
        await page.goto(address)
        await assert_moves(page)
        os.killpg(process, signal.SIGKILL)
        frozen = await card(page, lambda seen: bool(seen["isFrozen"]))
        assert "s old" in frozen["age"]
        await card(page, lambda seen: seen["state"] == "stale")
    async with whep_server(port=port):
        await assert_moves(page)


async def test_a_stream_with_lost_packets_shows_whole_images_only(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """Some packets are lost twice, so images are dropped until the next keyframe."""
    port = free_port()
    address, _ = await served(tmp_path, urc_process, port)
    page = await new_page()
    async with whep_server("--loss", "8", "--loss-again", "50", port=port):
        await page.goto(address)
        before = -1
        for _ in range(20):
            seen = await card(page, lambda one: is_live(one) and one["number"] != before)  # noqa: B023
            before = seen["number"]
            for place, colour in enumerate(seen["colours"]):
                assert colour[place] > 200, seen
                assert sum(colour) - colour[place] < 120, seen
            await asyncio.sleep(0.1)
