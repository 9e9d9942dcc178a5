"""Where dev pages are: only when turned on, only from this machine, with every page's policy."""

import re

import pytest
from starlette.testclient import TestClient

from urc.model.profile import Profile
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import HERE, OPEN
from urc.web.app import DashboardOptions, build_app
from urc.web.dev.routes import HOW_TO_TURN_ON
from urc.web.fleet.robots import Robot

HOSTILE = '"><script>alert(1)</script>{{ 7*7 }}'


def client(*, is_dev: bool, has_key: bool = True) -> TestClient:
    """Talk to a dashboard, with the start key or without."""
    robot = FakeRobot(dashboard_profile()._replace(title=HOSTILE))
    served = Robot(robot.profile, {}, robot.open)

    def remake(profile: Profile) -> Robot:
        return Robot(profile, {}, robot.open)

    app = build_app(
        {"puppet": served},
        DashboardOptions(access=OPEN, remake={"puppet": remake} if is_dev else None),
    )
    cookies = HERE if has_key else None
    return TestClient(app, base_url="http://localhost:8080", cookies=cookies)


def test_a_dev_page_has_the_policy_of_every_page_and_no_markup_of_a_robot() -> None:
    """Titles are text; each script has the page's nonce."""
    answer = client(is_dev=True).get("/robots/puppet/dev")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-store"
    nonce = re.search(r"'nonce-([\w-]{20,})'", answer.headers["content-security-policy"])
    assert nonce is not None
    scripts = re.findall(r"<script[^>]*>", answer.text)
    assert scripts
    assert all(f'nonce="{nonce[1]}"' in script for script in scripts)
    assert "alert(1)</script>" not in answer.text
    assert "{{ 7*7 }}" in answer.text


def test_the_menu_leads_to_it() -> None:
    """Only where there is one."""
    assert 'href="/robots/puppet/dev"' in client(is_dev=True).get("/").text
    assert '/dev"' not in client(is_dev=False).get("/").text


@pytest.mark.parametrize(
    ("is_dev", "has_key", "path", "status", "told"),
    [
        (False, True, "/robots/puppet/dev", 404, HOW_TO_TURN_ON),
        (True, True, "/robots/nobody/dev", 404, "This server has no robot called “nobody”."),
        (True, False, "/robots/puppet/dev", 403, "needs the start key"),
    ],
)
def test_where_there_is_no_dev_page_a_line_says_why(
    is_dev: bool, has_key: bool, path: str, status: int, told: str
) -> None:
    """Off, unknown, or asked for without the key."""
    answer = client(is_dev=is_dev, has_key=has_key).get(path)
    assert answer.status_code == status
    assert told in answer.text
