"""The calls about robots with a robot that a test plays: values, images, limits and recordings."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from urc.model.driver import Argument, Command
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, BEARER, person
from urc.testing.profile import text
from urc.web.api.limits import AT_ONCE, MOST_VISITORS, REQUESTS_PER_S, RequestLimits
from urc.web.api.readings import plain, value_of
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot
from urc.web.serve.replies import ApiError

JPEG = b"\xff\xd8\xff\xe0 a picture"
ADDRESS = "http://127.0.0.1:8080"
SIGNALS = {
    "battery": Signal("battery", "integer", stale_after_s=3.0),
    "photo": Signal("photo", "image"),
    "blob": Signal("blob", "blob"),
    "never": Signal("never", "string"),
}
COMMANDS = {
    "beep": Command("beep", "wire", text("BEEP"), {"times": Argument("times", "integer")}),
}


class Playing(FakeRobot):
    """A robot with readings from the start."""

    def open(self) -> Any:
        opened = super().open()

        class Opened:
            async def __aenter__(_) -> FakeRobot:  # noqa: N805 - the robot is self
                session = await opened.__aenter__()
                self.set_reading("battery", 42, age_s=1.0)
                self.set_reading("photo", JPEG)
                self.set_reading("blob", b"<script>")
                return session

            async def __aexit__(_, *fault: Any) -> None:  # noqa: N805
                await opened.__aexit__(*fault)

        return Opened()


@pytest.fixture
def robot() -> FakeRobot:
    return Playing(dashboard_profile(signals=SIGNALS, commands=COMMANDS))


@pytest.fixture
def api(robot: FakeRobot, tmp_path: Path) -> Iterator[TestClient]:
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)},
        DashboardOptions(access=ACCESS, recordings=tmp_path),
    )
    with TestClient(app, base_url=ADDRESS, headers=BEARER) as client:
        yield client


def test_a_value_has_its_age(api: TestClient) -> None:
    found = api.get("/api/v1/robots/puppet/signals/battery").json()
    assert found["value"] == 42
    assert 1.0 <= found["age_s"] < 3.0


def test_an_image_is_a_file_that_cannot_act_as_a_page(api: TestClient) -> None:
    """Bytes of a robot could be markup."""
    photo = api.get("/api/v1/robots/puppet/signals/photo")
    assert (photo.content, photo.headers["content-type"]) == (JPEG, "image/jpeg")
    assert int(photo.headers["x-urc-age-ms"]) >= 0
    blob = api.get("/api/v1/robots/puppet/signals/blob")
    assert blob.headers["content-type"] == "application/octet-stream"
    assert blob.headers["content-security-policy"].startswith("sandbox")
    assert blob.headers["x-content-type-options"] == "nosniff"
    listed = api.get("/api/v1/robots/puppet/signals").json()["values"]["photo"]
    assert listed["value"] == {"bytes": len(JPEG)}


def test_a_command_is_sent_once_with_its_arguments(api: TestClient, robot: FakeRobot) -> None:
    body = {"arguments": {"times": 3}}
    assert api.post("/api/v1/robots/puppet/commands/beep", json=body).status_code == 200
    assert robot.commands == [("beep", {"times": 3})]


def test_a_command_that_breaks_off_names_the_robot(api: TestClient, robot: FakeRobot) -> None:
    def fail(*_: object) -> dict[str, Any]:
        from urc.runtime.command_failed import CommandFailed

        raise CommandFailed("disconnected", "the line is cut")

    robot.on_command = fail
    answer = api.post("/api/v1/robots/puppet/commands/beep", json={"arguments": {"times": 3}})
    assert (answer.status_code, answer.json()["code"]) == (424, "disconnected")


def test_a_robot_without_motion_has_no_controls(api: TestClient) -> None:
    answer = api.post("/api/v1/robots/puppet/lease", json={"verb": "take"})
    assert (answer.status_code, answer.json()["code"]) == (409, "no-motion")


def test_a_document_that_is_gone_is_told(api: TestClient) -> None:
    """The robot of this test has no file."""
    answer = api.get("/api/v1/robots/puppet/document")
    assert (answer.status_code, answer.json()["code"]) == (409, "not-readable")


def test_only_files_of_recordings_are_listed_and_read(api: TestClient, tmp_path: Path) -> None:
    """No other file of the folder, and no link out of it."""
    good = "puppet-20261123T141502Z.mcap"
    (tmp_path / good).write_bytes(b"mcap")
    (tmp_path / "notes.txt").write_text("private")
    (tmp_path / "puppet-20261123T141503Z.mcap").symlink_to(tmp_path / "notes.txt")
    (tmp_path / "puppet-20261123T141504Z.mcap").mkdir()
    (listed,) = api.get("/api/v1/recordings").json()["recordings"]
    assert (listed["file"], listed["bytes"], listed["active"]) == (good, 4, False)
    assert api.get(f"/api/v1/recordings/{good}").content == b"mcap"
    for name in ("notes.txt", "puppet-20261123T141503Z.mcap", "puppet-20261123T141504Z.mcap"):
        assert api.get(f"/api/v1/recordings/{name}").status_code == 404


def test_recordings_of_other_robots_need_the_right_for_all(
    robot: FakeRobot, tmp_path: Path
) -> None:
    """A robot that is no longer served belongs to those who maintain all."""
    (tmp_path / "puppet-20261123T141502Z.mcap").write_bytes(b"mcap")
    (tmp_path / "gone-20261123T141502Z.mcap").write_bytes(b"mcap")
    seen = []
    for number, grant in enumerate(("maintain@puppet", "maintain", "maintain@gone")):
        app = build_app(
            {"puppet": Robot(robot.profile, {}, robot.open)},
            DashboardOptions(access=ACCESS, recordings=tmp_path),
        )
        cookies = person(f"recordings {number}", grant)
        with TestClient(app, base_url=ADDRESS, cookies=cookies) as client:
            found = client.get("/api/v1/recordings").json()["recordings"]
            seen.append([one["robot"] for one in found])
            status = client.get("/api/v1/recordings/gone-20261123T141502Z.mcap").status_code
            assert status == (200 if grant == "maintain" else 404)
    assert seen == [["puppet"], ["puppet", "gone"], []]


def test_a_server_without_a_folder_records_nothing(robot: FakeRobot) -> None:
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=ACCESS)
    )
    with TestClient(app, base_url=ADDRESS, headers=BEARER) as client:
        answer = client.post("/api/v1/robots/puppet/recordings/start")
        assert (answer.status_code, answer.json()["code"]) == (409, "no-folder")
        assert client.get("/api/v1/recordings").json() == {"recordings": []}
        stopped = client.post("/api/v1/robots/puppet/recordings/stop")
        assert (stopped.status_code, stopped.json()["code"]) == (409, "not-recording")


# ---- values


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (b"abc", {"bytes": 3}),
        ((1, (2.5, None)), [1, [2.5, None]]),
        ({"a": b"x", 1: True}, {"a": {"bytes": 1}, "1": True}),
        (2**64, "18446744073709551616"),
        (2**63, 2**63),
        ("\udc80", "?"),
    ],
)
def test_any_value_can_be_written_as_json(value: object, shown: object) -> None:
    assert plain(value) == shown


def test_a_signal_without_a_reading_is_stale() -> None:
    assert value_of(SIGNALS["battery"], None, 1.0).stale


# ---- limits


def test_a_visitor_has_a_rate_and_others_have_their_own() -> None:
    limits = RequestLimits()
    for _ in range(REQUESTS_PER_S):
        limits.count("mine", 1.0)
    with pytest.raises(ApiError) as refused:
        limits.count("mine", 1.0)
    assert refused.value.status == 429
    limits.count("other", 1.0)
    limits.count("mine", 1.1)


def test_the_table_of_rates_is_bounded() -> None:
    limits = RequestLimits()
    for number in range(3 * MOST_VISITORS):
        limits.count(f"visitor {number}", 1.0)
    assert len(limits._rates) == MOST_VISITORS


def test_few_commands_of_a_visitor_run_at_once() -> None:
    limits = RequestLimits()
    running = [limits.running("mine") for _ in range(AT_ONCE)]
    for one in running:
        one.__enter__()
    with pytest.raises(ApiError), limits.running("mine"):
        raise AssertionError
    with limits.running("other"):
        pass
    running[0].__exit__(None, None, None)
    with limits.running("mine"):
        pass
