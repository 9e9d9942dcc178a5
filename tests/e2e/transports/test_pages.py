"""The robots of the pages about transports drive their own emulated selves, out of one file."""

import asyncio
from pathlib import Path

import pytest

from tests.documentation import blocks
from urc.config.load import WidgetFolder, check
from urc.runtime.document_tests import sample_settings
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.emulated_profile import stand_in

pytestmark = pytest.mark.anyio

PAGES = Path(__file__).resolve().parents[3] / "docs" / "transports"
WAIT_S = 20.0


@pytest.mark.parametrize("page", ["tcp", "udp", "serial"])
async def test_robot_of_a_page_drives_its_emulated_self(page: str, tmp_path: Path) -> None:
    """Every line live, every signal read."""
    text = next(block.text for block in blocks(PAGES / f"{page}.md") if "kind: robot" in block.text)
    file = tmp_path / "robot.yaml"
    file.write_text(text, "utf-8")
    profile = check(str(file), built_in_catalog(), WidgetFolder(tmp_path)).profile
    assert profile is not None
    settings = sample_settings(profile.settings)
    async with (
        stand_in(profile, settings) as emulated,
        Session(emulated, settings, built_in_catalog().transports) as session,
    ):
        with session.hub.subscribe() as subscription:
            async with asyncio.timeout(WAIT_S):
                while not all(
                    session.hub.links[name].state == "live" for name in profile.driver.transports
                ) or not all(session.hub.latest(name) for name in profile.driver.signals):
                    subscription.changes()
                    await subscription.changed()
