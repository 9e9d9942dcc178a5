"""What a page says about the topics of a ROS robot, at the control and at the value."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import PAGE_TIMEOUT_MS
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.managing import running_managed
from tests.e2e.motion.driving import fingers_on, fresh
from tests.e2e.operator_input import OperatorInput
from tests.e2e.transports.ros_bases import Base, open_base
from urc.runtime.open_profile import open_document
from urc.runtime.settings_store import SettingsStore, StoredSettings

pytestmark = pytest.mark.anyio

expect.set_options(timeout=PAGE_TIMEOUT_MS)
GENERIC = Path(__file__).resolve().parents[2] / "robots" / "generic-ros2.yaml"
WRONG = "/cmd_vel takes TwistStamped, not Twist"


@asynccontextmanager
async def driven_wrongly(folder: Path) -> AsyncIterator[tuple[Base, str]]:
    """Serve a base that takes another type, and whose scan nothing publishes."""
    profile = open_document(GENERIC)
    async with open_base("foxglove", folder) as base:
        settings = {"port": str(base.port), "bridge": "foxglove", "scan": "/gone"}
        SettingsStore(folder / "data" / "robots", profile.name).save(
            StoredSettings(settings=settings)
        )
        async with running_managed(folder / "data", [profile], is_dev=True) as address:
            yield base, f"{address}robots/{profile.name}/"


async def until_idle(page: Page) -> None:
    await page.wait_for_function(
        "() => document.querySelector('.joystick')?.dataset.phase === 'idle'"
    )


async def test_a_stick_says_that_its_topic_has_another_type(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """It says so while it is held, too, and is not locked; the laser says that nothing comes."""
    async with driven_wrongly(tmp_path) as (base, address):
        page = await fresh(new_page, "tablet")
        await page.goto(address)
        await until_idle(page)
        note = page.locator(".joystick-note")
        await expect(note).to_contain_text(WRONG)
        laser = page.locator("[data-cell]").filter(has_text="Nothing publishes /gone")
        await expect(laser.first).to_be_visible()
        hand = OperatorInput(page, await fingers_on(page))
        await hand.hold(page.locator(".joystick-pad"), up=60)
        await expect(page.locator(".joystick")).to_have_attribute("data-phase", "held")
        await expect(note).to_contain_text(WRONG)
        await expect(page.locator(".joystick-values")).to_be_hidden()
        await until(lambda: base.unread > 0)
        await hand.lift()


@pytest.mark.needs("axe")
async def test_the_developer_page_lists_the_topics(new_page: PageMaker, tmp_path: Path) -> None:
    """With types, rates, nodes and uses, for everybody."""
    async with driven_wrongly(tmp_path) as (_, address):
        page = await prepare(await new_page(size="desktop"))
        await page.goto(f"{address}dev")
        await page.get_by_text("Topics", exact=True).click()
        rows = page.locator("[data-topics-rows] tr")
        odometry = rows.filter(has_text="/odom")
        await expect(odometry).to_contain_text("nav_msgs/msg/Odometry")
        await expect(odometry).to_contain_text("1: /base")
        await expect(odometry).to_contain_text("/s")
        await expect(odometry).to_contain_text("● x, y")
        await expect(rows.filter(has_text="/map")).to_contain_text("—")
        await expect(rows.filter(has_text="/cmd_vel")).to_contain_text("● drive")
        await expect(page.locator("[data-topics-state]")).to_contain_text("topics of ROS 2")
        assert await faults(page) == []
