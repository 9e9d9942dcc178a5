"""Where dev pages are: only when turned on, only from this machine, with every page's policy."""

import re

import pytest
from starlette.testclient import TestClient

from urc.model.profile import Profile
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.app import build_app
from urc.web.dev.routes import HOW_TO_TURN_ON
from urc.web.fleet.robots import Robot

HOSTILE = '"><script>alert(1)</script>{{ 7*7 }}'
HERE = ("127.0.0.1", 50_000)


def client(*, is_dev: bool, address: tuple[str, int] = HERE) -> TestClient:
    """Talk to a dashboard from an address."""
    robot = FakeRobot(dashboard_profile()._replace(title=HOSTILE))
    served = Robot(robot.profile, {}, robot.open)

    def remake(profile: Profile) -> Robot:
        return Robot(profile, {}, robot.open)

    app = build_app({"puppet": served}, remake={"puppet": remake} if is_dev else None)
    return TestClient(app, base_url="http://localhost:8080", client=address)


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
    assert "/dev" not in client(is_dev=False).get("/").text


@pytest.mark.parametrize(
    ("is_dev", "address", "path", "status", "told"),
    [
        (False, HERE, "/robots/puppet/dev", 404, HOW_TO_TURN_ON),
        (True, HERE, "/robots/nobody/dev", 404, "No robot of that name is served here."),
        (True, ("192.168.1.9", 50_000), "/robots/puppet/dev", 403, "only shown on the machine"),
    ],
)
def test_where_there_is_no_dev_page_a_line_says_why(
    is_dev: bool, address: tuple[str, int], path: str, status: int, told: str
) -> None:
    """Off, unknown, or asked for from elsewhere."""
    answer = client(is_dev=is_dev, address=address).get(path)
    assert answer.status_code == status
    assert told in answer.text
