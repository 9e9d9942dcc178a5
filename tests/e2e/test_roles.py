"""Roles on a page: a command that needs a higher role is disabled, and says which one."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.people_server import PASSPHRASE, is_refusal, people_server
from urc.access.grants import parse_grant
from urc.model.driver import Command
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

RING = Command("ring", "wire", WriteSpec("text", {}), title="Ring", role="maintain")
USE = WidgetUse("ring", "button", {}, {"press": "ring"}, {})


async def test_a_driver_sees_why_a_button_is_disabled_and_a_new_role_enables_it(
    new_page: PageMaker, tmp_path: Path
) -> None:
    page = await new_page()
    new_page.allow(page, is_refusal)
    robot = FakeRobot(dashboard_profile(uses=[USE], commands={"ring": RING}))
    async with people_server(tmp_path, robot) as server:
        ann = await server.add("Ann", "drive", passphrase=PASSPHRASE)
        await page.context.clear_cookies()
        await page.goto(f"{server.address}robots/puppet/")
        await page.get_by_label("Name").fill("Ann")
        await page.get_by_label("Passphrase").fill(PASSPHRASE)
        await page.get_by_role("button", name="Sign in", exact=True).click()
        button = page.locator(".button-main")
        await expect(page.locator(".button-note")).to_contain_text("this needs the role maintain")
        await expect(button).to_be_disabled()
        server.store.set_grants(ann.id, [parse_grant("maintain")])
        await server.access.control.reload()
        await expect(button).to_be_enabled()
        await button.click()
        await expect(page.locator(".button")).to_have_attribute("data-phase", "done")
    assert [name for name, _ in robot.commands] == ["ring"]
