"""Which widgets are foreign, and what their frames may load."""

import base64
import hashlib
import re
from pathlib import Path
from typing import NoReturn

import pytest
from starlette.testclient import TestClient

from urc.config.load import WidgetFolder
from urc.model.interface import WidgetUse
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile, plain_widget
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, Robot, build_app
from urc.web.load.widget_trust import OURS, WidgetTrust

CODE = " ".join(
    f"http://localhost:8080{ACCESS.frame_code}/{folder}/"
    for folder in ("static", "vendor", "words", "widgets/lamp")
)


def lamp(folder: Path) -> FakeRobot:
    """Return a robot that brings a widget of its own."""
    (folder / "lamp").mkdir()
    for name in ("widget.js", "widget.css"):
        (folder / "lamp" / name).write_text("", "utf-8")
    (folder / "lamp" / "template.html.j2").write_text("<p title='&lt;'>{{ title }}</p>", "utf-8")
    return FakeRobot(
        dashboard_profile(
            uses=[use_of("lamp"), use_of("battery")],
            widgets=[plain_widget("lamp", ["level"], folder / "lamp")],
        )
    )


def lamp_session() -> NoReturn:
    """Open no session: no page is opened here that wants one."""
    raise AssertionError


def use_of(widget: str) -> WidgetUse:
    """Return a use of a widget whose title is markup."""
    return WidgetUse(widget, widget, {"level": "battery"}, title="<i>")


def client(robot: FakeRobot, host: str = "localhost:8080", *trusted: str) -> TestClient:
    """Return a browser's place."""
    served = Robot(robot.profile, {}, robot.open)
    app = build_app({"puppet": served}, DashboardOptions(access=ACCESS, trusted=trusted))
    return TestClient(app, base_url=f"http://{host}", cookies=HERE)


def test_each_widget_that_ships_is_named() -> None:
    """A folder that somebody puts beside them is not taken for one of them."""
    names = WidgetFolder(shipped("widgets")).names()
    assert sorted(OURS) == names, (
        "name the widgets that ship with URC in urc/web/load/widget_trust.py"
    )


def test_a_widget_of_another_folder_is_foreign_whatever_its_name(tmp_path: Path) -> None:
    """Name and place must both be ours; a name can be trusted."""
    ours = plain_widget("battery", ["level"])
    named_so = plain_widget("battery", ["level"], tmp_path / "battery")
    beside = plain_widget("lamp", ["level"], shipped("widgets") / "lamp")
    border = WidgetTrust()
    assert [border.is_foreign(one) for one in (ours, named_so, beside)] == [False, True, True]
    assert not WidgetTrust.of(["lamp"]).is_foreign(beside)


def test_the_page_holds_a_foreign_widget_as_text_and_loads_nothing_of_it(tmp_path: Path) -> None:
    """Neither its markup nor its style sheet is in the page, unless it is trusted."""
    robot = lamp(tmp_path)
    page = client(robot).get("/robots/puppet/").text
    assert 'data-frame="/frames/lamp"' in page
    assert "&lt;p title=&#39;&amp;lt;&#39;&gt;&amp;lt;i&amp;gt;&lt;/p&gt;" in page
    assert "/widgets/lamp/widget.css" not in page
    assert "/widgets/battery/widget.css" in page
    page = client(robot, "localhost:8080", "lamp").get("/robots/puppet/").text
    assert "data-frame" not in page
    assert "<p title='&lt;'>&lt;i&gt;</p>" in page
    assert "/widgets/lamp/widget.css" in page


@pytest.mark.parametrize(("host", "code"), [("localhost:8080", CODE), ("[::1]:8080", "'self'")])
def test_a_frame_may_load_code_of_ours_and_its_own_and_reach_nothing(
    tmp_path: Path, host: str, code: str
) -> None:
    """No nonce, no connection, no origin; the import map by its digest alone."""
    answer = client(lamp(tmp_path), host).get("/frames/lamp")
    text = re.search(r'<script type="importmap">(.*?)</script>', answer.text)
    assert text is not None
    digest = base64.b64encode(hashlib.sha256(text[1].encode()).digest()).decode()
    assert answer.headers["content-security-policy"] == (
        f"sandbox allow-scripts; default-src 'none'; script-src 'sha256-{digest}' {code}; "
        f"style-src 'unsafe-inline' {code}; img-src data: blob: {code}; font-src data: {code}; "
        "media-src data: blob:; connect-src 'none'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'self'; require-trusted-types-for 'script'; trusted-types urc"
    )
    assert answer.headers["x-frame-options"] == "SAMEORIGIN"
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert "gamepad=()" in answer.headers["permissions-policy"]
    assert "access-control-allow-origin" not in answer.headers
    assert "puppet" not in answer.text


@pytest.mark.parametrize(
    "file", ["/static/widgets/kit.css", "/widgets/lamp/widget.js", "/words/de.js"]
)
def test_code_is_open_to_frames_and_to_no_other_site(tmp_path: Path, file: str) -> None:
    """By a path of this start, which only our own pages are told; a frame has no cookies."""
    app = build_app(
        {"puppet": Robot(lamp(tmp_path).profile, {}, lamp_session)}, DashboardOptions(access=ACCESS)
    )
    frame = TestClient(app, base_url="http://localhost:8080", headers={"origin": "null"})
    answer = frame.get(f"{ACCESS.frame_code}{file}")
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-origin"] == "*"
    assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
    site = TestClient(app, base_url="http://localhost:8080", cookies=HERE)
    for path in (file, f"/frame-code/guessed{file}"):
        answer = site.get(path, headers={"origin": "http://evil.example"})
        assert "access-control-allow-origin" not in answer.headers
        assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert frame.get("/widgets/lamp/widget.js").status_code == 401


@pytest.mark.parametrize(
    "path", ["/", "/healthz", "/robots/puppet/", "/api/v1/robots/puppet/timeline", "/frames/lamp"]
)
def test_nothing_but_code_is_below_the_path_of_frames(tmp_path: Path, path: str) -> None:
    browser = client(lamp(tmp_path))
    assert browser.get(f"{ACCESS.frame_code}{path}").status_code == 404


def test_there_is_a_frame_only_for_a_widget_that_is_served(tmp_path: Path) -> None:
    """And the API says nothing to whoever has no origin."""
    browser = client(lamp(tmp_path))
    for path in ("/frames/nope", "/frames/", "/frames/..%2fstatic", "/frames/LAMP"):
        assert browser.get(path).status_code == 404
    for path in ("/", "/healthz", "/robots/puppet/", "/api/v1/robots/puppet/timeline"):
        answer = browser.get(path, headers={"origin": "null"})
        assert "access-control-allow-origin" not in answer.headers
    posted = browser.post("/api/v1/robots/puppet/stop", headers={"origin": "null"})
    assert posted.status_code == 403
