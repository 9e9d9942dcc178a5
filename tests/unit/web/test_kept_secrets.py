"""A secret goes to the place for which it was entered, and to no other.

The attacks: a page changes the host and leaves the password; a new package takes the name of one
that is gone, an update leads elsewhere, and a test of settings sends what was given at the start.
"""

from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from tests.unit.packages.made import DOCUMENTS, install, package
from urc.model.profile import Profile
from urc.model.values import Value
from urc.packages.store import Store
from urc.runtime.settings_store import SettingsStore, StoredSettings
from urc.testing.dashboard import FakeRobot
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robot_factory import RobotOptions
from urc.web.fleet.robots import Robot

ADDRESS = "http://localhost:8080"
PASSWORD = "open sesame"  # noqa: S105
AGAIN = "Enter the value again: it was for another destination or package."


class Wire:
    """Notes the settings with which robots are tried or made."""

    def __init__(self) -> None:
        self.tried: list[dict[str, Value]] = []
        self.used: list[dict[str, Value]] = []

    @asynccontextmanager
    async def session(self, profile: Profile, values: Mapping[str, Value]) -> AsyncIterator[Any]:
        """Take the place of a session that tries the lines."""
        self.tried.append(dict(values))
        raise AssertionError("a robot was tried")
        yield

    def robot(self, profile: Profile, values: Mapping[str, Value]) -> Robot:
        """Return a robot that is not there."""
        self.used.append(dict(values))
        return Robot(profile, values, FakeRobot(profile).open)


@contextmanager
def served(
    data: Path, wire: Wire, given: Mapping[str, Value] | None = None
) -> Iterator[TestClient]:
    """Serve what is installed to a browser at this machine."""
    robot_options = RobotOptions(
        data,
        make=wire.robot,
        tried=wire.session,
        given=lambda profile: {
            name: value for name, value in (given or {}).items() if name in profile.settings
        },
        shows_installed=True,
    )
    with TestClient(
        build_app({}, DashboardOptions(access=ACCESS, data=data, robot_options=robot_options)),
        base_url=ADDRESS,
        headers={"origin": ADDRESS},
        cookies=HERE,
        follow_redirects=False,
    ) as client:
        yield client


def fill_in(client: TestClient, *, test: bool = False, **settings: str | None) -> dict[str, Any]:
    """Fill in the rover's settings; None leaves a secret as it is."""
    said = {"settings": settings, "test": test, "anyway": True}
    answer = client.post("/api/v1/robots/rover/settings", json=said)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def stock(data: Path) -> None:
    install(Store(data / "packages"), package("driver", "rover"))


def test_a_kept_secret_does_not_follow_a_changed_host(tmp_path: Path) -> None:
    """Neither when it is tried nor when it is saved; nothing is lost, and the page says why."""
    stock(tmp_path)
    wire = Wire()
    file = SettingsStore(tmp_path / "robots", "rover")
    with served(tmp_path, wire) as client:
        assert fill_in(client, host="10.0.0.5", key=PASSWORD)["isSaved"]
        stolen = fill_in(client, test=True, host="203.0.113.66", key=None)
        assert stolen["faults"] == {"key": AGAIN}
        assert not stolen["isSaved"]
        assert file.load().settings == {"host": "10.0.0.5", "key": PASSWORD}
        assert fill_in(client, host="10.0.0.5", key=None)["isSaved"]
        assert fill_in(client, host="203.0.113.66", key="another")["isSaved"]
    assert wire.tried == []
    sent = {(one["host"], one.get("key")) for one in wire.used}
    assert ("203.0.113.66", PASSWORD) not in sent
    assert ("10.0.0.5", PASSWORD) in sent


def test_a_secret_given_at_the_start_does_not_follow_a_changed_host(tmp_path: Path) -> None:
    stock(tmp_path)
    wire = Wire()
    with served(tmp_path, wire, given={"key": PASSWORD}) as client:
        assert "Not set yet" not in client.get("/").text
        stolen = fill_in(client, test=True, host="203.0.113.66", key=None)
        assert stolen["faults"] == {"key": AGAIN}
        part = fill_in(client, test=True, host="203.0.113.66")
        assert part["text"] == "Saved. Not set yet: Key."
        assert AGAIN in client.get("/robots/rover/settings").text
    with served(tmp_path, wire, given={"key": PASSWORD}) as client:  # nor by a restart
        assert "Not set yet: Key" in client.get("/").text
        assert fill_in(client, host="203.0.113.66", key="another")["isSaved"]
        assert "Not set yet" not in client.get("/").text
    assert wire.tried == []
    sent = {(one["host"], one.get("key")) for one in wire.used}
    assert sent == {("127.0.0.1", PASSWORD), ("203.0.113.66", None), ("203.0.113.66", "another")}


def test_a_secret_given_at_the_start_is_not_for_what_is_installed_later(tmp_path: Path) -> None:
    wire = Wire()
    with served(tmp_path, wire, given={"key": PASSWORD}) as client:
        stock(tmp_path)
        assert "Not set yet: Key" in client.get("/").text
    assert all("key" not in one for one in wire.used)


def test_a_secret_goes_with_its_package(tmp_path: Path) -> None:
    """Another package of that name, and one that comes after it, do not get it."""
    stock(tmp_path)
    wire = Wire()
    file = SettingsStore(tmp_path / "robots", "rover")
    with served(tmp_path, wire) as client:
        fill_in(client, host="10.0.0.5", key=PASSWORD)
        told = client.post("/api/v1/packages/remove", json={"package": "rover"}).json()
        assert told["hasSettings"]
        client.post("/api/v1/packages/remove", json={"package": "rover", "yes": True})
        assert not file.file.exists()
        stock(tmp_path)
        assert "Not set yet: Key" in client.get("/").text
        fill_in(client, host="10.0.0.5", key=PASSWORD)
        body = {"package": "rover", "yes": True, "forget": False}
        client.post("/api/v1/packages/remove", json=body)
        assert file.load().settings["key"] == PASSWORD
        text = DOCUMENTS["driver"]
        install(Store(tmp_path / "packages"), package("robot", "rover", text=text))
        assert "Not set yet: Key" in client.get("/").text
        assert AGAIN in client.get("/robots/rover/settings").text


def test_an_update_that_leads_elsewhere_asks_again(tmp_path: Path) -> None:
    """With a fixed host, or with one more line; going back has the secret still."""
    stock(tmp_path)
    wire = Wire()
    leak = "  leak: { type: udp, host: 203.0.113.66, port: 53 }\nsignals:"
    changed = {
        "2.0.0": DOCUMENTS["driver"].replace('"{{ settings.host }}"', "203.0.113.66"),
        "3.0.0": DOCUMENTS["driver"]
        .replace("signals:", leak)
        .replace("beep: { send", "beep: { to: wire, send")
        .replace("said: {", "said: { from: wire,"),
    }
    for version, text in changed.items():
        install(Store(tmp_path / "packages"), package("driver", "rover", version, text=text))
    with served(tmp_path, wire) as client:
        said = {"settings": {"host": "10.0.0.5", "key": PASSWORD}, "test": False}
        url = "/api/v1/robots/rover/settings"
        assert client.post(url, json={**said, "version": "1.0.0"}).json()["isSaved"]
        for version in changed:
            kept = {"settings": {"host": "10.0.0.5", "key": None}, "version": version}
            assert client.post(url, json=kept).json()["faults"] == {"key": AGAIN}
        back = {"settings": {"host": "10.0.0.5", "key": None}, "version": "1.0.0", "test": False}
        assert client.post(url, json=back).json()["isSaved"]
    assert wire.tried == []


def test_a_file_of_an_earlier_version_is_asked_for_again(tmp_path: Path) -> None:
    """It noted no place. The secret stays in the file until it is entered again or forgotten."""
    stock(tmp_path)
    file = SettingsStore(tmp_path / "robots", "rover")
    file.save(StoredSettings(settings={"host": "10.0.0.5", "key": PASSWORD}))
    wire = Wire()
    with served(tmp_path, wire) as client:
        assert "Not set yet: Key" in client.get("/").text
        page = client.get("/robots/rover/settings").text
        assert "10.0.0.5" in page
        assert AGAIN in page
        assert file.load().settings["key"] == PASSWORD
        assert fill_in(client, host="10.0.0.5", key=PASSWORD)["isSaved"]
        assert "Not set yet" not in client.get("/").text
