"""Managing over HTTP: who may, what fits, what is refused in one line; no repository is asked."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import DOCUMENTS, install, keep_settings, package
from urc.model.profile import Profile, Setting
from urc.packages.package import Package
from urc.packages.store import Store
from urc.runtime.settings_store import SettingsStore, StoredSettings
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import HERE, OPEN, person
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robot_factory import RobotOptions
from urc.web.fleet.robots import Robot
from urc.web.manage.catalogue import PackageCatalog
from urc.web.manage.upload_source import given_source
from urc.web.serve.rights import FRESH_S

ADDRESS = "http://localhost:8080"


def robot_options(data: Path, **more: Any) -> RobotOptions:
    """Return what makes robots that are not there."""

    def untried(*_: object) -> Any:
        raise AssertionError("nothing is tried here")

    return RobotOptions(
        data,
        make=lambda profile, values: Robot(profile, values, FakeRobot(profile).open),
        tried=untried,
        given=more.pop("given", lambda _: {}),
        shows_installed=True,
        **more,
    )


@contextmanager
def served(
    data: Path, *profiles: Profile, cookies: dict[str, str] = HERE, **more: Any
) -> Iterator[TestClient]:
    """Give a browser, with a key or without, at a dashboard with its managers."""
    robots = {one.name: Robot(one, {}, FakeRobot(one).open) for one in profiles}
    app = build_app(
        robots, DashboardOptions(access=OPEN, data=data, robot_options=robot_options(data, **more))
    )
    with TestClient(
        app,
        base_url=ADDRESS,
        headers={"origin": ADDRESS},
        cookies=cookies,
        follow_redirects=False,
    ) as started:
        yield started


def stock(data: Path) -> None:
    """Install a driver, with the widget that it needs, and an interface."""
    store = Store(data / "packages")
    dial = package("widget", "dial")
    install(store, package("driver", "rover", needs={"widgets/dial": "*"}), dial)
    install(store, package("interface", "wide"))


POSTS = [
    ("repositories", {"url": "http://10.0.0.5/"}),
    ("repositories/remove", {"url": "http://10.0.0.5/"}),
    ("packages/install", {"package": "drivers/rover"}),
    ("packages/add", {"path": "/interfaces/wide/"}),
    ("packages/update", {"package": "drivers/rover"}),
    ("packages/back", {"package": "drivers/rover"}),
    ("packages/remove", {"package": "drivers/rover", "yes": True}),
    ("job/agree", {"number": 1}),
    ("job/cancel", {"number": 1}),
    ("robots/rover/settings", {"settings": {}, "test": False}),
]


@pytest.mark.parametrize(("path", "body"), POSTS)
def test_only_who_has_a_key_may_change_anything(
    tmp_path: Path, path: str, body: dict[str, object]
) -> None:
    """No stranger, not a foreign page, and nothing that a foreign page could send."""
    stock(tmp_path)
    before = Store(tmp_path / "packages").installed()
    with served(tmp_path, cookies={}) as client:
        answer = client.post(f"/api/v1/{path}", json=body)
        assert answer.status_code == 403
        assert "the role maintain" in answer.json()["error"]
    with served(tmp_path) as client:
        assert client.get(f"/api/v1/{path}").status_code in (404, 405)
        foreign = {"origin": "http://evil.example"}
        assert client.post(f"/api/v1/{path}", json=body, headers=foreign).status_code == 403
        plain = client.post(f"/api/v1/{path}", content="{}", headers={"content-type": "text/plain"})
        assert plain.status_code == 415
        wrong = client.post(f"/api/v1/{path}", json={"no": "such key"})
        assert wrong.status_code == 400
        assert "does not match the schema" in wrong.json()["error"]
        long = client.post(f"/api/v1/{path}", json={**body, "x": "x" * (1 << 20)})
        assert long.status_code == 413
    assert Store(tmp_path / "packages").installed() == before


def test_a_person_with_the_role_maintain_may(tmp_path: Path) -> None:
    """But a path of this machine is only named with the start key."""
    stock(tmp_path)
    with served(tmp_path, cookies=person("Mia", "maintain")) as client:
        gone = client.post("/api/v1/packages/remove", json={"package": "wide", "yes": True})
        assert gone.json()["gone"] == ["interfaces/wide 1.0.0"]
        path = client.post("/api/v1/packages/add", json={"path": "/etc/passwd"})
        assert path.status_code == 403
        assert "full path" not in client.get("/interfaces").text


def test_a_sign_in_of_long_ago_changes_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tablet that was left signed in does not suffice."""
    stock(tmp_path)
    with served(tmp_path, cookies=person("Mio", "maintain")) as client:
        later = OPEN.control.now() + FRESH_S + 1
        monkeypatch.setattr(OPEN.control, "now", lambda: later)
        kept = client.post("/api/v1/packages/remove", json={"package": "wide", "yes": True})
    assert kept.status_code == 403
    assert "this needs a sign-in within the last 5 minutes" in kept.json()["error"]


def test_only_pages_of_ours_have_repositories_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A picture in a foreign page is a GET, and a GET sends nothing to anybody."""
    asked: list[bool] = []
    monkeypatch.setattr(PackageCatalog, "refresh", lambda self, force=False: asked.append(force))
    with served(tmp_path) as client:
        for query in ("", "?anew", "?force=true"):
            assert client.get(f"/api/v1/packages{query}").status_code == 200
        client.get("/drivers")
        assert client.get("/api/v1/repositories/ask").status_code == 405
        foreign = {"origin": "http://evil.example"}
        url = "/api/v1/repositories/ask"
        assert client.post(url, json={"force": True}, headers=foreign).status_code == 403
        assert asked == []
        assert client.post(url, json={"force": True}).status_code == 202
        assert asked == [True]
    with served(tmp_path, cookies={}) as client:
        assert client.post(url, json={"force": True}).status_code == 202
    assert asked == [True, False]


def test_the_pages_say_who_may(tmp_path: Path) -> None:
    with served(tmp_path, cookies={}) as client:
        for page in ("/drivers", "/interfaces", "/widgets/installed"):
            text = client.get(page).text
            assert "You can view the packages." in text
            assert "<form" not in text
    with served(tmp_path) as client:
        assert "data-connect" in client.get("/drivers").text


def test_texts_of_documents_are_text_on_these_pages(tmp_path: Path) -> None:
    """Scripts have the page's nonce, whatever a robot, a setting or a file's name says."""
    evil = '"><script>alert(1)</script>'
    settings = {"host": Setting("host", "host", title=evil, description=evil, default=evil)}
    profile = dashboard_profile(settings=settings)._replace(title=evil, file=evil)
    with served(tmp_path, profile) as client:
        SettingsStore(tmp_path / "robots", "puppet").save(StoredSettings(settings={"host": evil}))
        for page in ("/", "/drivers", "/interfaces", "/robots/puppet/settings"):
            answer = client.get(page)
            assert answer.status_code == 200
            assert "<script>alert" not in answer.text
            nonces = set(re.findall(r'<script nonce="([^"]+)"', answer.text))
            assert len(nonces) == 1
            assert answer.text.count("<script") == answer.text.count("<script nonce=")
            assert f"'nonce-{nonces.pop()}'" in answer.headers["content-security-policy"]


def test_what_is_installed_stands_on_the_menu(tmp_path: Path) -> None:
    """With what is not set yet; once it is removed, so is its card."""
    stock(tmp_path)
    with served(tmp_path) as client:
        page = client.get("/").text
        assert "drivers/rover 1.0.0" in page
        assert "Not set yet: Key." in page
        assert client.get("/robots/rover/").headers["location"] == "/robots/rover/settings"
        told = client.post("/api/v1/packages/remove", json={"package": "drivers/rover"})
        assert told.json()["gone"] == ["drivers/rover 1.0.0", "widgets/dial 1.0.0"]
        assert "drivers/rover" in client.get("/").text
        client.post("/api/v1/packages/remove", json={"package": "drivers/rover", "yes": True})
        assert "No driver yet" in client.get("/").text
        assert client.get("/robots/rover/settings").status_code == 404
        again = client.post("/api/v1/packages/remove", json={"package": "drivers/rover"})
        text = "drivers/rover is not installed, or is installed only as a dependency"
        assert again.json()["error"] == text


def test_a_damaged_package_costs_its_own_card(tmp_path: Path) -> None:
    stock(tmp_path)
    store = Store(tmp_path / "packages")
    driver = next(one for one in store.installed() if one.root == "drivers/rover")
    store.blob_file(driver.packages["drivers/rover"].sha256).write_bytes(b"rubbish")
    with served(tmp_path, dashboard_profile()) as client:
        page = client.get("/").text
        assert "Cannot be used" in page
        assert "Connect to Puppet" in page
        cache = client.get("/api/v1/packages?kinds=driver").json()
        assert "damaged" in cache["installed"][0]["fault"]


def test_a_store_that_cannot_be_read_costs_no_robot(tmp_path: Path) -> None:
    """The robots that were named are served, and the manager's page says what is wrong."""
    stock(tmp_path)
    (tmp_path / "packages" / "state.json").write_text("rubbish", encoding="utf-8")
    with served(tmp_path, dashboard_profile()) as client:
        assert "Connect to Puppet" in client.get("/").text
        answer = client.get("/api/v1/packages")
        assert answer.status_code == 422
        assert "this file is damaged" in answer.json()["error"]


def test_an_interface_that_fits_is_offered(tmp_path: Path) -> None:
    """Whatever robot it is; one that fits none says so."""
    stock(tmp_path)
    store = Store(tmp_path / "packages")
    install(store, package("interface", "other", text="grid: |\n  nothing\n"))
    with served(tmp_path) as client:
        found = client.get("/api/v1/packages?kinds=interface").json()["installed"]
        assert {one["name"]: one["fits"] for one in found} == {"wide": ["Rover"], "other": []}
        assert "wide" in client.get("/robots/rover/settings").text


def send(client: TestClient, **said: object) -> dict[str, Any]:
    """Fill in the rover's settings."""
    answer = client.post("/api/v1/robots/rover/settings", json={"test": False, **said})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_settings_are_checked_kept_and_used(tmp_path: Path) -> None:
    """One line for each field that is wrong; nothing is kept of a form with one."""
    stock(tmp_path)
    file = SettingsStore(tmp_path / "robots", "rover")
    with served(tmp_path) as client:
        wrong = send(client, settings={"host": "http://x", "key": "open sesame"})
        assert wrong["faults"] == {"host": "'http://x' is not a host name or an address"}
        assert not wrong["isSaved"]
        assert file.load().settings == {}
        unknown = send(client, settings={"no-such": "1"})
        assert unknown["faults"] == {"no-such": "the driver has no setting with this name"}
        part = send(client, settings={"host": "10.0.0.7", "key": ""})
        assert part["text"] == "Saved. Not set yet: Key."
        assert send(client, settings={"host": "10.0.0.7", "key": "open sesame"})["isSaved"]
        assert send(client, settings={"host": "10.0.0.7", "key": None})["isSaved"]
        assert send(client, settings={"host": "10.0.0.8", "key": "open sesame"})["isSaved"]
        assert file.load().settings == {"host": "10.0.0.8", "key": "open sesame"}
        assert client.get("/robots/rover/").status_code == 200
        for page in ("/", "/robots/rover/settings"):
            assert "open sesame" not in client.get(page).text
        assert "10.0.0.8" in client.get("/robots/rover/settings").text
    with served(tmp_path) as client:
        assert "10.0.0.8" in client.get("/robots/rover/settings").text


ROS = """\
settings:
  host: { type: host, default: 127.0.0.1 }
  fleet: { type: string, default: "" }
  namespace: { type: string, default: "" }
transports:
  ros:
    type: ros
    host: "{{ settings.host }}"
    namespace: "{{ settings.fleet }}/{{ settings.namespace }}"
signals:
  x: {}
messages:
  odom: { subscribe: { topic: odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
"""


def test_a_wrong_namespace_is_refused_even_without_a_test_of_the_connection(
    tmp_path: Path,
) -> None:
    """The robot could not be connected with it; both settings in it are marked."""
    install(Store(tmp_path / "packages"), package("driver", "rover", text=ROS))
    file = SettingsStore(tmp_path / "robots", "rover")
    words = "words of letters, digits and _, separated by /, such as fleet/robot1"
    with served(tmp_path) as client:
        for given in ("robot 1", "2fast", "a//b", "ß", "x-1"):
            for more in ({}, {"anyway": True}):
                wrong = send(client, settings={"namespace": given}, **more)
                why = f"'/{given}' is not a ROS namespace: it must consist of {words}"
                assert wrong["faults"] == {"fleet": why, "namespace": why}
                assert (wrong["isSaved"], wrong["text"]) == (
                    False,
                    "Not saved: correct the marked fields",
                )
        assert file.load().settings == {}
        for given in ({}, {"fleet": "yard"}, {"fleet": "yard", "namespace": "robot_1"}):
            assert send(client, settings=given)["isSaved"]
        assert file.load().settings == {"fleet": "yard", "namespace": "robot_1"}


def test_what_was_given_at_the_start_is_not_changed(tmp_path: Path) -> None:
    stock(tmp_path)
    with served(tmp_path, given=lambda _: {"host": "10.9.9.9"}) as client:
        page = client.get("/robots/rover/settings").text
        assert "Set when URC was started" in page
        send(client, settings={"host": "10.0.0.7", "key": "x"})
        assert "10.9.9.9" in client.get("/robots/rover/settings").text


def test_a_damaged_file_of_settings_is_told_and_replaced(tmp_path: Path) -> None:
    stock(tmp_path)
    file = SettingsStore(tmp_path / "robots", "rover")
    file.file.parent.mkdir(parents=True)
    file.file.write_text("rubbish", encoding="utf-8")
    with served(tmp_path) as client:
        assert "this file is damaged" in client.get("/").text
        assert "this file is damaged" in client.get("/robots/rover/settings").text
        assert send(client, settings={"key": "x"})["isSaved"]
        assert "damaged" not in client.get("/").text


def test_nothing_changes_under_who_drives(tmp_path: Path) -> None:
    """Not the settings, not the driver: who drives gives the controls back first."""
    stock(tmp_path)
    with served(tmp_path) as client:
        send(client, settings={"key": "x"})
        fleet_of(client).driven_by = lambda _: "screen 1"
        fleet_of(client).is_out_of_reach = lambda _: False
        answer = client.post("/api/v1/robots/rover/settings", json={"test": False})
        assert answer.status_code == 409
        assert "rover is being driven (screen 1)" in answer.json()["error"]
        gone = client.post("/api/v1/packages/remove", json={"package": "rover", "yes": True})
        assert gone.status_code == 409
    assert len(Store(tmp_path / "packages").installed()) == 2


def test_settings_of_a_robot_out_of_reach_are_corrected_while_its_stop_is_pending(
    tmp_path: Path,
) -> None:
    """A wrong address may be the reason; its package stays as it is."""
    stock(tmp_path)
    with served(tmp_path) as client:
        send(client, settings={"key": "x"})
        fleet_of(client).driven_by = lambda _: "a pending stop"
        answer = client.post("/api/v1/robots/rover/settings", json={"test": False})
        assert answer.status_code == 200
        gone = client.post("/api/v1/packages/remove", json={"package": "rover", "yes": True})
        assert gone.status_code == 409


def fleet_of(client: TestClient) -> Any:
    """Return the robots behind a dashboard."""
    app: Any = client.app
    return next(route.endpoint.__self__.fleet for route in app.routes if route.path == "/healthz")


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("x.yaml", "kind: driver\nname: x\n", "expected an interface"),
        ("x.yaml", "kind: interface\nname: A B\n", "expected 'name'"),
        ("x.yaml", "a: [", "x.yaml:"),
        ("x.zip", "rubbish", "x.zip"),
        ("x.exe", "rubbish", "x.exe"),
        ("../../x.yaml", "kind: driver\n", "x.yaml: expected an interface"),
    ],
)
def test_what_is_uploaded_must_be_a_package(
    tmp_path: Path, name: str, text: str, line: str
) -> None:
    with served(tmp_path) as client:
        answer = client.post(
            f"/api/v1/packages/upload?name={name}",
            content=text,
            headers={"content-type": "application/octet-stream"},
        )
        assert answer.status_code == 422
        assert line in answer.json()["error"]
        assert "given." not in answer.json()["error"]


def test_a_bare_interface_gets_a_version_that_is_new(tmp_path: Path) -> None:
    text = f"urc: 1\nkind: interface\nname: wide\n{DOCUMENTS['interface']}".encode()
    store = Store(tmp_path)
    first = given_source("wide.yaml", text, store.installed())
    assert first.packages[0].manifest.version == "0.0.1"
    install(store, package("interface", "wide", "1.2.0"))
    later = given_source("wide.yaml", text, store.installed())
    assert later.packages[0].manifest.version == "1.2.1"


def test_each_type_of_setting_has_its_field(tmp_path: Path) -> None:
    settings = {
        "hosts": Setting("hosts", "host"),
        "speed": Setting("speed", "integer", min=1, max=9),
        "look": Setting("look", "choice", choices=("near", "far"), default="near"),
        "brave": Setting("brave", "boolean", default=False),
        "file": Setting("file", "path"),
        "key": Setting("key", "string", is_secret=True),
    }
    with served(tmp_path, dashboard_profile(settings=settings)) as client:
        page = client.get("/robots/puppet/settings").text
    assert "1 to 9" in page
    assert 'inputmode="numeric"' in page
    assert "Default: near" in page
    assert "Default: no" in page
    assert 'type="password"' in page


def with_dial(name: str, version: str) -> list[Package]:
    """Return a driver that shows its battery with a version of a widget, and that widget."""
    look = "widgets:\n  battery: { use: dial, bind: { level: battery } }\n"
    needs = {"widgets/dial": version}
    driver = package("driver", name, needs=needs, text=DOCUMENTS["driver"] + look)
    return [driver, package("widget", "dial", version, about=version)]


def test_two_robots_may_need_two_versions_of_a_widget(tmp_path: Path) -> None:
    """Each page loads the one that its driver was installed with; the same one is one."""
    store = Store(tmp_path / "packages")
    for name, version in (("a", "1.0.0"), ("b", "2.0.0"), ("c", "1.0.0")):
        install(store, *with_dial(name, version))
        keep_settings(tmp_path, name, {"key": "x"})
    with served(tmp_path) as client:
        assert "Cannot be used" not in client.get("/").text
        dials = {name: dial_of(client.get(f"/robots/{name}/").text) for name in "abc"}
        assert dials["a"] == dials["c"] == "dial"
        assert dials["b"].startswith("dial.")
        assert client.get(f"/widgets/{dials['b']}/widget.js").status_code == 200


def dial_of(page: str) -> str:
    """Return the name by which a page loads its dial."""
    found = re.search(r"&#34;widget&#34;: &#34;(dial[^&]*)&#34;", page)
    assert found is not None
    return found[1]


def test_what_another_program_installs_is_seen(tmp_path: Path) -> None:
    """As `urc install` beside a dashboard that runs."""
    with served(tmp_path) as client:
        assert "No driver yet" in client.get("/").text
        stock(tmp_path)
        assert "drivers/rover 1.0.0" in client.get("/").text


def test_what_may_stay_empty_does_not_keep_anybody_from_connecting(tmp_path: Path) -> None:
    """Nor does a text whose default is empty."""
    settings = {
        "key": Setting("key", "string", is_secret=True, is_required=False),
        "port": Setting("port", "port", is_required=False),
        "name": Setting("name", "string", default=""),
    }
    with served(tmp_path, dashboard_profile(settings=settings)) as client:
        assert "Not set yet" not in client.get("/").text
        assert client.get("/robots/puppet/").status_code == 200
        assert "Optional." in client.get("/robots/puppet/settings").text
