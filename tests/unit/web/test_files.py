"""Files that documents name, and tiles: what is served, and that nothing else can be reached."""

import os
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.config.folder import WIRE, head
from urc.config.load import check
from urc.config.parse.widget import WidgetFolder
from urc.model.interface import WidgetUse
from urc.runtime.package_preview import permissions
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot
from urc.web.load.files import linked_options

ARM = f"""{WIRE}signals:
  angles: {{ type: array, unit: rad }}
messages:
  m: {{ split: {{ by: " ", fields: ["angles..."] }} }}
"""
SLOT = "widgets:\n  arm: {{ use: scene3d, bind: {{ joints: angles }}, options: {} }}\n"


def robot_in(folder: Path, options: str, *, name: str = "robot") -> WidgetUse | list[str]:
    """Return the slot of a robot whose document stands in `folder`, or what is wrong with it."""
    file = folder / f"{name}.yaml"
    file.write_text(head("robot", name) + ARM + SLOT.format(options), "utf-8")
    checked = check(file, built_in_catalog(), WidgetFolder(shipped("widgets")))
    if checked.profile is None:
        return [problem.message for problem in checked.problems if problem.severity == "error"]
    return checked.profile.slots["arm"]


def client_of(use: WidgetUse, tiles: Path | None = None) -> TestClient:
    robot = FakeRobot(dashboard_profile(uses=[use]))
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)},
        DashboardOptions(access=ACCESS, tiles=tiles),
    )
    return TestClient(app, base_url="http://localhost:8080", cookies=HERE)


def test_a_file_beside_the_document_has_an_address_and_nothing_else_has(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "arm.urdf").write_text("<robot/>", "utf-8")
    (tmp_path / "model" / "secret.urdf").write_text("<secret/>", "utf-8")
    use = robot_in(tmp_path, "{ urdf: model/arm.urdf }")
    assert isinstance(use, WidgetUse)
    url = str(linked_options(use, "puppet")["urdf"])
    assert url.startswith("/robots/puppet/files/")
    assert url.endswith("/model/arm.urdf")
    client = client_of(use)
    answer = client.get(url)
    assert (answer.status_code, answer.text) == (200, "<robot/>")
    assert answer.headers["content-type"] == "application/xml"
    assert answer.headers["content-security-policy"].startswith("sandbox; default-src 'none'")
    tag = answer.headers["etag"]
    assert client.get(url, headers={"if-none-match": tag}).status_code == 304
    for other in (
        url.replace("arm.urdf", "secret.urdf"),
        url.replace("model/", "model%2F..%2Fmodel%2F"),
        url.replace("puppet", "other"),
        "/robots/puppet/files/model/arm.urdf",
        "/robots/puppet/files/" + str(tmp_path / "robot.yaml"),
    ):
        assert client.get(other).status_code == 404, other
    (tmp_path / "model" / "arm.urdf").unlink()
    assert client.get(url).status_code == 404


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ("{ urdf: ../arm.urdf }", "is not a path inside this document's folder"),
        ("{ urdf: /etc/passwd.urdf }", "is not a path inside this document's folder"),
        ("{ urdf: a/../../arm.urdf }", "is not a path inside this document's folder"),
        ("{ urdf: 'file:arm.urdf' }", "is not a path inside this document's folder"),
        ("{ urdf: robot.yaml }", "has a file type that is not served"),
        ("{ urdf: link.urdf }", "is outside this document's folder"),
        ("{ meshes: [gone.stl] }", "there is no file 'gone.stl'"),
    ],
)
def test_a_file_that_pages_are_not_given_is_a_finding(
    tmp_path: Path, options: str, fault: str
) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (tmp_path / "arm.urdf").write_text("<robot/>", "utf-8")
    os.symlink(tmp_path / "arm.urdf", folder / "link.urdf")
    found = robot_in(folder, options)
    assert isinstance(found, list)
    assert len(found) == 1
    assert fault in found[0]


def test_files_of_one_name_in_two_documents_are_two(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.urdf").write_text(name, "utf-8")
    uses = [robot_in(tmp_path / name, "{ urdf: a.urdf }") for name in ("one", "two")]
    urls = {str(linked_options(use, "p")["urdf"]) for use in uses if isinstance(use, WidgetUse)}
    assert len(urls) == 2


def test_a_tile_is_served_from_its_folder_and_a_clear_one_where_there_is_none(
    tmp_path: Path,
) -> None:
    (tmp_path / "tiles" / "3" / "4").mkdir(parents=True)
    (tmp_path / "tiles" / "3" / "4" / "5.png").write_bytes(b"picture")
    (tmp_path / "secret.png").write_bytes(b"secret")
    use = WidgetUse("map", "map", {})
    client = client_of(use, tmp_path / "tiles")
    assert client.get("/tiles/3/4/5.png").content == b"picture"
    clear = client.get("/tiles/3/4/6.png")
    assert clear.status_code == 200
    assert clear.content.startswith(b"\x89PNG")
    for other in (
        "/tiles/3/8/5.png",  # beyond the edge of the world
        "/tiles/3/4/8.png",
        "/tiles/99/0/0.png",
        "/tiles/3/4/5.svg",
        "/tiles/3/4/../../../secret.png",
        "/tiles/3/4/..%2F..%2Fsecret.png",
        "/tiles/-1/0/0.png",
        "/tiles/3/4/5",
    ):
        assert client.get(other).status_code == 404, other
    assert client_of(use).get("/tiles/3/4/5.png").status_code == 404


def page_in(folder: Path, options: str) -> WidgetUse:
    """Return the slot of a robot that shows a page."""
    file = folder / "robot.yaml"
    slot = f"widgets:\n  arm: {{ use: iframe, options: {options} }}\n"
    file.write_text(head("robot", "robot") + ARM + slot, "utf-8")
    checked = check(file, built_in_catalog(), WidgetFolder(shipped("widgets")))
    assert checked.profile is not None, checked.problems
    return checked.profile.slots["arm"]


def test_a_page_of_somebody_else_has_an_address_whose_policy_names_its_origin_alone(
    tmp_path: Path,
) -> None:
    use = page_in(tmp_path, "{ url: 'HTTPS://Wiki.local:8443/a?b=', label: wiki }")
    options = linked_options(use, "puppet")
    assert options["label"] == "wiki"
    answer = client_of(use).get(str(options["url"]))
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert policy.startswith(
        "default-src 'none'; frame-src https://wiki.local:8443; style-src 'sha"
    )
    assert "frame-ancestors 'self'" in policy
    assert "script" not in policy + answer.text.replace("allow-scripts", "")
    assert 'src="HTTPS://Wiki.local:8443/a?b="' in answer.text
    assert client_of(use).get("/robots/puppet/framed/0123456789abcdef").status_code == 404
    assert client_of(use).get(str(options["url"]).replace("puppet", "other")).status_code == 404


@pytest.mark.parametrize("url", ["http://LOCALHOST:8080/", "https://localhost:8080/robots/puppet/"])
def test_a_page_of_the_dashboard_itself_is_not_framed(tmp_path: Path, url: str) -> None:
    use = page_in(tmp_path, f"{{ url: '{url}' }}")
    answer = client_of(use).get(str(linked_options(use, "puppet")["url"]))
    assert answer.status_code == 404
    assert "frame-src 'none'" in answer.headers["content-security-policy"]
    assert "<iframe" not in answer.text
    assert "pages of the dashboard itself cannot be shown here" in answer.text


def test_no_page_has_no_address(tmp_path: Path) -> None:
    use = page_in(tmp_path, "{ url: 'http://wiki.local/a' }")._replace(options={"url": ""})
    assert linked_options(use, "puppet")["url"] == ""


def test_whoever_installs_a_robot_or_a_layout_is_told_of_the_pages_that_it_shows(
    tmp_path: Path,
) -> None:
    page_in(tmp_path, "{ url: 'http://wiki.local/a' }")
    layout = tmp_path / "layout.yaml"
    layout.write_text(
        head("interface", "layout")
        + "grid: wiki\n"
        + "widgets:\n  wiki: { use: iframe, options: { url: 'http://wiki.local/b' } }\n",
        "utf-8",
    )
    assert "makes the browser show the page http://wiki.local/a" in permissions(
        tmp_path / "robot.yaml", tmp_path, ()
    )
    assert permissions(layout, tmp_path, ()) == [
        "makes the browser show the page http://wiki.local/b"
    ]
