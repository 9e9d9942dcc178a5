"""From the address of a ROS robot to the driven robot, in the page, without writing a document."""

import asyncio
import logging
from pathlib import Path

import pytest
from httpx2 import AsyncClient
from playwright.async_api import expect

from tests.e2e.browser import PAGE_TIMEOUT_MS
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.managing import running_managed
from tests.e2e.motion.driving import fingers_on, fresh
from tests.e2e.operator_input import OperatorInput
from tests.e2e.ports import free_port
from tests.e2e.transports.ros_bases import BASES, TOPICS, open_base
from urc.packages.store import Store
from urc.runtime.open_profile import open_document
from urc.testing.entry import BEARER, person

pytestmark = pytest.mark.anyio

expect.set_options(timeout=PAGE_TIMEOUT_MS)
STAMPED = "geometry_msgs/TwistStamped"
PARTS = ("odom", "scan", "camera", "battery", "map")
MOST_S = 60.0
MOST_TAPS = 6

log = logging.getLogger(__name__)


def client_of(address: str) -> AsyncClient:
    return AsyncClient(base_url=address, headers=BEARER, timeout=30)


def new_robot(port: int, **more: object) -> dict[str, object]:
    return {
        "title": "Scout",
        "host": "127.0.0.1",
        "port": port,
        "via": "foxglove",
        "version": 2,
        "commandType": STAMPED,
        "topics": {"cmd_vel": "/cmd_vel", "odom": "/odom"},
        **more,
    }


@pytest.mark.parametrize("line", BASES)
async def test_a_robot_is_found_and_added_with_its_settings(line: str, tmp_path: Path) -> None:
    """And a second robot with the same title gets another name."""
    async with (
        open_base(line, tmp_path) as base,
        running_managed(tmp_path / "data") as address,
        client_of(address) as client,
    ):
        asked = {"host": "127.0.0.1", "port": base.port}
        reply = await client.post("api/v1/new/topics", json=asked)
        found = reply.json()
        assert reply.status_code == 200, found
        assert (found["via"], found["port"], found["version"]) == (line, base.port, 2)
        assert found["parts"]["cmd_vel"] == [{"name": "/cmd_vel", "type": STAMPED}]
        topics = {part: found["parts"][part][0]["name"] for part in ("cmd_vel", *PARTS)}
        assert list(topics.values()) == ["/cmd_vel", *TOPICS]
        names = []
        for _ in range(2):
            body = new_robot(base.port, via=line, topics=topics)
            reply = await client.post("api/v1/new/robot", json=body)
            assert reply.status_code == 201, reply.text
            names.append(reply.json()["name"])
        assert names == ["scout", "scout-2"]
        page = await client.get("robots/scout/settings")
        assert "/camera/image_raw/compressed" in page.text
        listed = (await client.get("api/v1/robots")).json()
        assert names[0] in {one["name"] for one in listed["robots"]}
    store = Store(tmp_path / "data" / "packages")
    locks = [one for one in store.installed() if one.key.name == "scout"]
    (drive,) = [open_document(store.document(one)).driver.commands["drive"] for one in locks]
    assert STAMPED in str(drive.send.options["attributes"])


async def test_what_the_page_refuses(tmp_path: Path) -> None:
    """A stranger, a robot that cannot be driven, an invalid topic, and an unused address."""
    async with running_managed(tmp_path) as address:
        driver = person("Otto of the new robot", "drive")
        async with AsyncClient(base_url=address, cookies=driver) as client:
            for path, body in (("topics", {"host": "127.0.0.1"}), ("robot", new_robot(1))):
                reply = await client.post(
                    f"api/v1/new/{path}", json=body, headers={"origin": address.rstrip("/")}
                )
                assert reply.status_code == 403, reply.text
        async with client_of(address) as client:
            refused = {
                "needs a topic for odom": (422, new_robot(1, topics={"cmd_vel": "/cmd_vel"})),
                "Object contains unknown field": (400, new_robot(1, other=1)),
                "matching regex": (400, new_robot(1, topics={"cmd_vel": "/{{ 7 }}"})),
            }
            for text, (status, body) in refused.items():
                reply = await client.post("api/v1/new/robot", json=body)
                assert (reply.status_code, text in reply.text) == (status, True), reply.text
            asked = {"host": "127.0.0.1", "port": free_port()}
            reply = await client.post("api/v1/new/topics", json=asked)
            assert reply.status_code == 422
            assert "nothing listens on" in reply.json()["message"]
            assert (await client.get("api/v1/robots")).json()["robots"] == []


@pytest.mark.parametrize("line", BASES)
async def test_an_address_becomes_a_driven_robot_within_a_minute(
    line: str, new_page: PageMaker, tmp_path: Path
) -> None:
    """The taps and the time of the machine, with the times of a model for the person."""
    async with open_base(line, tmp_path) as base, running_managed(tmp_path / "data") as address:
        page = await fresh(new_page, "tablet")
        hand = OperatorInput(page, await fingers_on(page))
        await page.goto(address)
        hand.begin()
        await hand.tap(page.get_by_role("link", name="New ROS robot"))
        await page.locator("[name='host']").wait_for()
        await expect(page.locator("[data-choose]")).to_be_hidden()
        await page.locator("[name='host']").fill("127.0.0.1")
        await page.locator("[name='port']").fill(str(base.port))
        hand.keys += len(f"127.0.0.1{base.port}") + 1
        await hand.tap(page.get_by_role("button", name="Find topics"))
        add = page.get_by_role("button", name="Add the robot")
        await expect(add).to_be_enabled()
        await expect(page.locator("[name='cmd_vel']")).to_have_value("/cmd_vel")
        await add.scroll_into_view_if_needed()
        await hand.tap(add)
        await page.wait_for_url("**/robots/**")
        stick = page.locator(".joystick-pad")
        await page.wait_for_function(
            "() => document.querySelector('.joystick')?.dataset.phase === 'idle'"
        )
        await hand.hold(stick, up=60)
        await until(lambda: any(speed > 0 for speed in base.speeds))
        used = hand.account()
        await hand.lift()
        await until(lambda: base.speeds[-1] == 0)
        log.info("a new robot over %s: %s", line, used)
        assert used["model_s"] <= MOST_S, used
        assert used["touches"] <= MOST_TAPS, used
        note = page.locator(".joystick-note")
        await asyncio.sleep(0.5)
        await expect(note).not_to_contain_text("subscribes")
