"""Packages as people get them: real repositories, hostile servers, kills at any moment."""

import functools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from tests.e2e.command_line import TIMEOUT_S
from tests.e2e.keys import headers_for
from tests.e2e.package_people import Person
from tests.e2e.processes import ROOT, UrcProcess
from tests.unit.packages.made import package, write_package
from urc.packages.signature import new_signer

DRIVER_WIDGETS = "widgets:\n  battery: { use: dial, bind: { level: battery } }\n"
ROBOT = """\
driver: ../../drivers/puppet/driver.yaml
interfaces:
  default: ../../interfaces/plain/interface.yaml
"""


def fill(folder: Path) -> None:
    """Write a robot with its driver, widget and interface into a repository's folder."""
    from tests.unit.packages.made import DOCUMENTS

    write_package(folder, "widget", "dial", "1.0.0")
    write_package(folder, "interface", "plain", "1.0.0")
    text = DOCUMENTS["driver"] + DRIVER_WIDGETS
    write_package(folder, "driver", "puppet", "1.0.0", {"widgets/dial": "^1"}, text=text)
    needs = {"drivers/puppet": "^1", "interfaces/plain": "*"}
    write_package(folder, "robot", "my-puppet", "1.0.0", needs, text=ROBOT)


@pytest.fixture
def others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], Person]:
    """Return people by the names of their folders."""
    return lambda name: Person(tmp_path / name, capsys, monkeypatch)


@pytest.fixture
def person(others: Callable[[str], Person]) -> Person:
    return others("data")


@contextmanager
def repository(folder: Path) -> Iterator[str]:
    key = folder.parent / "keeper.pem"
    if not key.exists():
        new_signer("Keeper", key)
    words = ["repo", "serve", str(folder), "--port", "0", "--name", "Lab", "--key", str(key)]
    process = UrcProcess(words, {})
    try:
        yield process.wait_for(r"^repository (http://\S+)$")[1]
        process.interrupt()
    finally:
        process.kill()


@contextmanager
def server(handler: Callable[..., BaseHTTPRequestHandler]) -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{http.server_port}/"
        finally:
            http.shutdown()
            thread.join(TIMEOUT_S)


def got(url: str, **headers: str) -> tuple[int, bytes, str]:
    try:
        sent = headers_for(url) | headers
        request = Request(url, headers=sent)  # noqa: S310 (addresses of our own servers)
        with urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
            return answer.status, answer.read(), answer.headers["etag"]
    except HTTPError as error:
        with error:
            return error.code, error.read(), error.headers["etag"]


def test_a_robot_is_got_once_and_driven_for_ever_without_a_network(
    tmp_path: Path, person: Person
) -> None:
    """Search, look at what it may do, install; then the repository is switched off."""
    fill(tmp_path / "lab")
    with repository(tmp_path / "lab") as url:
        assert f"added {url}: Lab, 4 package versions" in person.does("repo", "add", url)
        assert person.does("repo", "list").startswith(f"{url}  signed by Keeper (SHA256:")
        assert person.does("repo", "search", "DIAL") == "widgets/dial 1.0.0  The widget dial.\n"
        assert "use --yes to confirm in advance" in person.does("install", "my-puppet", code=2)
        assert person.does("list") == ""
        told = person.does("install", "my-puppet", "--yes")
    assert "robots/my-puppet 1.0.0 has these permissions:" in told
    assert "connects by tcp (wire): host from the settings: {{ settings.host }}" in told
    assert "port always 6789" in told
    assert "secret: receives the value of the setting key" in told
    assert "commands: beep" in told
    assert "widget dial: a program in" in told
    assert person.does("list").startswith("robots/my-puppet 1.0.0  with drivers/puppet 1.0.0, ")
    person.does("repo", "search")
    assert "its last stored index is used" in person.complaints
    assert "`wire` | tcp" in person.does("docs", "my-puppet")
    words = ["serve", "my-puppet", "--simulate", "--port", "0"]
    dashboard = UrcProcess(words, {"URC_DATA_DIR": str(person.folder)})
    try:
        page = dashboard.wait_for(r"^dashboard (http://\S+)$")[1]
        assert b"my-puppet" in got(page)[1]
        assert (
            got(f"{page}widgets/dial/widget.js")[1] == package("widget", "dial").files["widget.js"]
        )
        dashboard.interrupt()
    finally:
        dashboard.kill()
    gone = person.does("remove", "my-puppet")
    assert gone.splitlines() == [
        "removed drivers/puppet 1.0.0", "removed interfaces/plain 1.0.0",
        "removed robots/my-puppet 1.0.0", "removed widgets/dial 1.0.0",
    ]  # fmt: skip
    kept = [name for name in person.holds() if name.startswith("packages/")]
    assert kept == ["packages/state.json"]


def test_the_repository_answers_as_the_thesis_says(tmp_path: Path) -> None:
    """Figures B.2 and B.3, and an index that is not sent twice."""
    fill(tmp_path / "lab")
    with repository(tmp_path / "lab") as url:
        assert json.loads(got(url)[1]) == {
            "name": "Lab",
            "drivers": ["/drivers/puppet/"],
            "interfaces": ["/interfaces/plain/"],
            "widgets": ["/widgets/dial/"],
            "robots": ["/robots/my-puppet/"],
        }
        assert json.loads(got(f"{url}drivers")[1]) == ["/drivers/puppet/"]
        assert json.loads(got(f"{url}widgets")[1]) == ["/widgets/dial/"]
        assert json.loads(got(f"{url}interfaces")[1]) == ["/interfaces/plain/"]
        said = json.loads(got(f"{url}drivers/puppet/urcpm.json")[1])
        assert said == {
            "name": "puppet", "description": "The driver puppet.", "type": "driver",
            "main": "driver.yaml", "dependencies": [], "css": {}, "widgets": ["/widgets/dial/"],
            "interfaces": [],
        }  # fmt: skip
        said = json.loads(got(f"{url}widgets/dial/urcpm.json")[1])
        assert (said["main"], said["css"]) == ("widget.js", [])
        assert said["resources"]["template.html.j2"] == "template.html.j2"
        assert got(f"{url}widgets/dial/{said['main']}")[1].startswith(b"export default")
        status, index, tag = got(f"{url}index.json")
        assert (status, len(json.loads(index)["packages"])) == (200, 4)
        assert got(f"{url}index.json", **{"if-none-match": tag})[:2] == (304, b"")
        for path in ("..%2f..%2fetc/passwd", "drivers/../x", "index.json%00", ".work", "nothing"):
            assert got(url + path)[0] in (400, 404), path


def test_the_same_folder_works_on_any_static_server(
    tmp_path: Path, person: Person, others: Callable[[str], Person]
) -> None:
    """`urc repo index` writes all that is needed; a new version appears beside the old one."""
    lab = tmp_path / "lab"
    fill(lab)
    key = tmp_path / "keeper.pem"
    new_signer("Keeper", key)
    assert "4 package versions" in person.does("repo", "index", str(lab), "--key", str(key))
    first = (lab / "index.json").read_bytes()
    person.does("repo", "index", str(lab), "--key", str(key))
    assert (lab / "index.json").read_bytes() == first
    with server(functools.partial(_Quiet, directory=str(lab))) as url:
        person.does("repo", "add", url)
        lock = tmp_path / "bot.lock"
        person.does("install", "drivers/puppet", "--yes", "--lock", str(lock))
        write_package(lab, "widget", "dial", "1.1.0", more="new")
        assert "5 package versions" in person.does("repo", "index", str(lab), "--key", str(key))
        assert person.does("search", "dial") == "widgets/dial 1.1.0  The widget dial.\n"
        assert person.does("list", "--updates") == (
            "drivers/puppet 1.0.0  with widgets/dial 1.0.0 → 1.1.0\n"
        )
        other = others("other")
        other.does("repo", "add", url)
        other.does("install", "drivers/puppet", "--yes", "--lock", str(lock))
        assert other.holds() == person.holds()
        third = others("third")
        third.does("repo", "add", url)
        third.does("install", "drivers/puppet", "--yes")
        assert third.does("list") == "drivers/puppet 1.0.0  with widgets/dial 1.1.0\n"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        pass


def test_what_is_not_sound_is_not_listed(tmp_path: Path, person: Person) -> None:
    """Each with its reason; the rest is."""
    lab = tmp_path / "lab"
    fill(lab)
    person.does("repo", "index", str(lab))
    (lab / "widgets/dial/more.txt").write_text("changed")
    write_package(lab, "driver", "broken", text="transports: { wire: { type: pigeon } }\n")
    write_package(lab, "robot", "nosy", text=f"driver: {'../' * 3}secret.yaml\n")
    (tmp_path / "secret.yaml").write_text("urc: 1\nkind: driver\nname: secret\n")
    (lab / "archives/widgets/dial/9.9.9.zip").write_bytes(b"PK nonsense")
    told = person.does("repo", "index", str(lab), code=1)
    assert "the package has changed since widgets/dial 1.0.0 was listed" in told
    assert "drivers/broken/driver.yaml:4:" in told
    assert "robots/nosy/robot.yaml: the document refers to" in told
    assert "which is not in this repository" in told
    assert "9.9.9.zip: the archive is truncated" in told
    listed = json.loads((lab / "index.json").read_bytes())["packages"]
    assert len(listed) == 4


def test_a_bundle_goes_where_no_network_is(
    tmp_path: Path, person: Person, others: Callable[[str], Person]
) -> None:
    """One file; the same bytes whoever makes it; installed from a memory stick."""
    fill(tmp_path / "lab")
    one, two = tmp_path / "one.urcof", tmp_path / "two.urcof"
    robot = str(tmp_path / "lab/robots/my-puppet")
    person.does("repo", "key", "new", "Anna")
    assert "4 packages" in person.does("bundle", robot, "--to", str(one))
    other = others("other")
    other.does("install", str(one), "--yes")
    assert other.does("list").startswith("robots/my-puppet 1.0.0  with drivers/puppet 1.0.0")
    other.does("bundle", "my-puppet", "--to", str(two))
    assert one.read_bytes() == two.read_bytes()
    before = other.holds()
    data = one.read_bytes()
    for name, evil in {
        "cut": data[: len(data) // 2],
        "changed": data.replace(b"The widget dial", b"The widget dia1", 1),
        "nothing": b"",
    }.items():
        (tmp_path / f"{name}.urcof").write_bytes(evil)
        told = other.does("install", str(tmp_path / f"{name}.urcof"), "--yes", code=1)
        assert told.startswith("urc install: ")
        assert told.count("\n") == 1
    assert other.holds() == before


def test_an_unsigned_bundle_needs_a_waiver_of_each_package(
    tmp_path: Path, person: Person, others: Callable[[str], Person]
) -> None:
    """By an option for one installation, or by a stored waiver that is listed."""
    fill(tmp_path / "lab")
    bundle = str(tmp_path / "one.urcof")
    person.does("bundle", str(tmp_path / "lab/drivers/puppet"), "--to", bundle)
    other = others("other")
    told = other.refuses("install", bundle, "--yes")
    assert "drivers/puppet 1.0.0 and widgets/dial 1.0.0 are not signed" in told
    told = other.refuses("install", bundle, "--yes", "--allow-unsigned", "puppet")
    assert "add: --allow-unsigned widgets/dial" in told
    assert other.does("list") == ""
    other.does("repo", "unsigned", "add", "widgets/dial")
    assert other.does("repo", "unsigned", "list") == "widgets/dial\n"
    other.does("install", bundle, "--yes", "--allow-unsigned", "drivers/puppet")
    assert other.does("list") == "drivers/puppet 1.0.0  with widgets/dial 1.0.0\n"
    other.does("repo", "unsigned", "remove", "widgets/dial")
    assert other.does("repo", "unsigned", "list") == ""
    assert "expected 'urc repo unsigned' with" in other.does("repo", "unsigned", "x", code=2)


def test_a_package_may_not_reach_out_or_replace_what_ships(tmp_path: Path, person: Person) -> None:
    """Neither a document outside, nor the name of a widget that URC has."""
    nosy = write_package(tmp_path, "robot", "nosy", text=f"driver: {'../' * 6}secret.yaml\n")
    (tmp_path / "secret.yaml").write_text("urc: 1\nkind: driver\nname: secret\n")
    told = person.does("install", str(nosy), "--yes", code=1)
    assert "which is not in the package" in told
    stop = write_package(tmp_path, "widget", "stop")
    told = person.does("install", str(stop), "--yes", code=1)
    assert "widgets/stop: packages must not replace URC's built-in widget 'stop'" in told
    broken = write_package(tmp_path, "driver", "broken", text="signals: { a: { type: x } }\n")
    assert "error" in person.does("install", str(broken), "--yes", code=1)
    assert person.holds() == {}


@pytest.mark.parametrize(
    "how",
    [("add",), ("update",), ("back",), ("remove",), ("publish",), ("random", "200", "7")],
    ids=lambda how: how[0],
)
def test_a_kill_at_any_moment_leaves_the_store_whole(tmp_path: Path, how: tuple[str, ...]) -> None:
    """Whatever is done: before every change of the disk, and at 200 random moments."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.e2e.package_killer", str(tmp_path), *how],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        timeout=80, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "whole after" in done.stdout
