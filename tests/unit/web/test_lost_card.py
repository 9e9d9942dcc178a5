"""The card of a lost robot on its page: always there, hidden at first, with the driver's hints."""

import html
import json
import re
from pathlib import Path

from starlette.testclient import TestClient

from tests.unit.web.test_manage_routes import robot_options
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot


def page_of(tmp_path: Path | None = None, hint: str = "") -> str:
    """Return the page of a robot; with a folder, the server has settings."""
    profile = dashboard_profile()
    wire = profile.driver.transports["wire"]._replace(hint=hint)
    profile = profile._replace(driver=profile.driver._replace(transports={"wire": wire}))
    robot = FakeRobot(profile)
    options = robot_options(tmp_path) if tmp_path is not None else None
    app = build_app(
        {"puppet": Robot(profile, {}, robot.open)},
        DashboardOptions(access=ACCESS, robot_options=options),
    )
    with TestClient(app, base_url="http://localhost:8080", cookies=HERE) as client:
        return client.get("/robots/puppet/").text


def card_of(page: str) -> str:
    """Return the markup of the card."""
    found = re.search(r'<section class="urc-lost".*?</section>', page, re.DOTALL)
    assert found is not None
    return found[0]


def test_the_card_is_hidden_at_first() -> None:
    assert re.search(r"<section [^>]* hidden>", card_of(page_of()))


def test_another_interface_replaces_the_stage_and_leaves_the_card() -> None:
    page = page_of()
    assert page.index("</main>") < page.index('class="urc-lost"')


def test_the_settings_are_one_tap_away_where_the_server_has_them(tmp_path: Path) -> None:
    assert 'href="/robots/puppet/settings"' not in card_of(page_of())
    assert 'href="/robots/puppet/settings"' in card_of(page_of(tmp_path))


def test_the_hint_of_the_driver_is_on_the_card() -> None:
    hint = 'Is the "dongle" plugged in?'
    told = re.search(r'data-hints="([^"]*)"', card_of(page_of(hint=hint)))
    assert told is not None
    assert json.loads(html.unescape(told[1])) == {"wire": hint}
    assert 'data-hints="{}"' in card_of(page_of())
