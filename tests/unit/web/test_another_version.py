"""Another version of what is installed is an update: read first, waited for, and chosen by hand.

The attack: a package of the same name, with the sign of the speed turned, which would have been
driven at once, by whoever had the controls.
"""

import time
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import accepted, install, package, write_package
from tests.unit.web.test_manage_routes import fleet_of, served
from urc.cli.main import main
from urc.cli.packages import RISKS_FLAG, installed_document
from urc.packages.install import plan_file
from urc.packages.package import Package, pack_folder
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.runtime import isolation
from urc.runtime.package_preview import look
from urc.testing.entry import OPEN

ATTACK = Path(__file__).parents[2] / "attacks" / "drivers" / "rover"
BEFORE = (ATTACK / "driver.yaml").read_text(encoding="utf-8").replace("-speed", "speed")
DOCUMENT = BEFORE.partition("name: rover\n")[2]


@pytest.fixture(autouse=True)
def preview_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """tests/unit/runtime/test_isolation.py starts the process; here it would start forty times."""
    monkeypatch.setattr(isolation, "look_apart", look)


def stock(data: Path) -> Store:
    """Install version 1.0.0."""
    store = Store(data / "packages")
    install(store, package("driver", "rover", text=DOCUMENT))
    return store


def asked(client: TestClient, path: str, **how: Any) -> dict[str, Any]:
    """Begin a job and wait for its question; return what it says."""
    answer = client.post(f"/api/v1/packages/{path}", **how)
    assert answer.status_code == 202, answer.text
    for _ in range(2000):
        job: dict[str, Any] = client.get("/api/v1/packages").json()["job"]
        if job["state"] != "working":
            assert job["state"] == "asks", job["line"]
            return job
        time.sleep(0.01)
    raise AssertionError(job)


def agree(client: TestClient, job: dict[str, Any], **more: object) -> Any:
    said = {"number": job["number"], "unsigned": job["unsigned"], **more}
    return client.post("/api/v1/job/agree", json=said)


def update(store: Store, newer: Package) -> None:
    """Put another version in the place of the one that is installed, as `urc update` does."""
    (old,) = store.installed()
    source = FileSource("test", [newer], [newer.manifest.key])
    plan = plan_file(source, (), store, lambda line: None)
    with store.changing() as change:
        change.stage(accepted(plan))
        change.replace(old, plan)


def speed_of(client: TestClient) -> str:
    """Return what the rover that is served would be sent."""
    send = fleet_of(client).robots["rover"].profile.driver.commands["drive"].send
    (template,) = (one for one in send.options.values() if hasattr(one, "render"))
    text: str = template.render({"speed": 1})
    return text


WAYS = {
    "add": {"json": {"path": str(ATTACK)}},
    "upload?name=rover.zip": {
        "content": pack_folder(ATTACK).data,
        "headers": {"content-type": "application/octet-stream"},
    },
}


@pytest.mark.parametrize("way", WAYS)
def test_another_version_shows_what_it_changes_and_waits_to_be_chosen(
    tmp_path: Path, way: str
) -> None:
    stock(tmp_path)
    with served(tmp_path) as client:
        client.get("/")
        assert speed_of(client) == "drive 1"
        job = asked(client, way, **WAYS[way])
        assert job["isUpdate"]
        assert job["packages"] == ["drivers/rover 1.0.0 → 2.0.0"]
        assert '+ commands.drive.send: "drive {{ -speed }}"' in job["wire"]
        assert job["stays"] == "1.0.0"
        assert agree(client, job).json()["state"] == "done"
        client.get("/")
        assert speed_of(client) == "drive 1"
        said = {"settings": {"host": "10.0.0.5"}, "version": "2.0.0", "test": False}
        assert client.post("/api/v1/robots/rover/settings", json=said).json()["isSaved"]
        assert speed_of(client) == "drive -1"
    with served(tmp_path) as client:
        client.get("/")
        assert speed_of(client) == "drive -1"


def test_an_unsigned_upload_needs_a_waiver_by_name(tmp_path: Path) -> None:
    """A package from a path on this machine is the user's own, and needs none."""
    store = stock(tmp_path)
    with served(tmp_path) as client:
        assert asked(client, "add", **WAYS["add"])["unsigned"] == []
        job = asked(client, "upload?name=rover.zip", **WAYS["upload?name=rover.zip"])
        assert job["unsigned"] == ["drivers/rover"]
        for names in ([], ["drivers/other"], ["rover"]):
            refused = agree(client, job, unsigned=names)
            assert refused.status_code == 422
            assert "drivers/rover: not signed: approve each package" in refused.json()["error"]
        assert [lock.version for lock in store.installed()] == ["1.0.0"]
        assert agree(client, job).json()["state"] == "done"
    assert [lock.version for lock in store.installed()] == ["1.0.0", "2.0.0"]
    assert store.state().waived == ()


def test_another_version_is_not_chosen_by_a_restart(tmp_path: Path) -> None:
    stock(tmp_path)
    with served(tmp_path) as client:
        client.get("/")
        agree(client, asked(client, "add", **WAYS["add"]))
    with served(tmp_path) as client:
        client.get("/")
        assert speed_of(client) == "drive 1"


def test_another_version_waits_while_the_robot_is_driven(tmp_path: Path) -> None:
    store = stock(tmp_path)
    with served(tmp_path) as client:
        client.get("/")
        job = asked(client, "add", **WAYS["add"])
        fleet = fleet_of(client)
        fleet.driven_by = lambda _: "screen 1"
        refused = agree(client, job)
        assert refused.status_code == 409
        assert "rover is being driven (screen 1)" in refused.json()["error"]
    assert [str(lock) for lock in store.installed()] == ["drivers/rover 1.0.0"]


def test_an_update_by_another_program_waits_for_the_controls(tmp_path: Path) -> None:
    store = stock(tmp_path)
    with served(tmp_path) as client:
        client.get("/")
        fleet = fleet_of(client)
        fleet.driven_by = lambda _: "screen 1"
        update(
            store, package("driver", "rover", "3.0.0", text=DOCUMENT.replace("speed }}", "3 }}"))
        )
        client.get("/")
        assert speed_of(client) == "drive 1"
        fleet.driven_by = lambda _: ""
        client.get("/")
        assert speed_of(client) == "drive 3"


def test_a_robot_does_not_take_the_place_of_a_driver_by_itself(tmp_path: Path) -> None:
    """Two packages may have one name; the one that is in use stays, over a restart, too."""
    stock(tmp_path)
    robot = package("robot", "rover", text=DOCUMENT.replace("speed }}", "9 }}"))
    with served(tmp_path) as client:
        client.get("/")
        body = {"content": robot.data, "headers": {"content-type": "application/octet-stream"}}
        job = asked(client, "upload?name=rover.zip", **body)
        assert any("drivers/rover 1.0.0 stays in use" in line for line in job["notes"])
        assert agree(client, job).json()["state"] == "done"
        client.get("/")
        assert speed_of(client) == "drive 1"
    with served(tmp_path) as client:
        client.get("/")
        assert speed_of(client) == "drive 1"


def test_what_cannot_be_compared_can_still_be_replaced(tmp_path: Path) -> None:
    """A damaged version must not keep a whole one out."""
    store = stock(tmp_path)
    (old,) = store.installed()
    store.blob_file(old.packages["drivers/rover"].sha256).write_bytes(b"rubbish")
    with served(tmp_path) as client:
        job = asked(client, "add", **WAYS["add"])
        assert not job["isUpdate"]
        assert any("drivers/rover 1.0.0" in line and "are unknown" in line for line in job["notes"])


def test_urc_install_of_what_cannot_be_compared_is_not_agreed_to_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    store = stock(tmp_path)
    (old,) = store.installed()
    store.blob_file(old.packages["drivers/rover"].sha256).write_bytes(b"rubbish")
    assert main(["install", str(ATTACK), "--yes"]) == 1
    said = capsys.readouterr().err
    assert "cannot show the changes, because drivers/rover 1.0.0 cannot be read" in said
    assert "--allow-more" in said
    assert main(["install", str(ATTACK), "--yes", "--allow-more"]) == 0


def test_urc_install_shows_and_asks_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--yes` is not enough where it may do more; the version in use stays."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    store = stock(tmp_path)
    assert main(["install", str(ATTACK), "--yes"]) == 0
    said = capsys.readouterr().out
    assert '+ commands.drive.send: "drive {{ -speed }}"' in said
    assert "1.0.0 remains in use" in said
    with served(tmp_path) as client:
        client.get("/")
        assert speed_of(client) == "drive 1"
    leak = "  leak: { type: udp, host: 203.0.113.66, port: 53 }\nsignals:"
    text = DOCUMENT.replace("signals:", leak).replace("    send:", "    to: wire\n    send:")
    text = text.replace("said: {", "said: { from: wire,")
    folder = write_package(tmp_path / "shop", "driver", "rover", "3.0.0", text=text)
    assert main(["install", str(folder), "--yes"]) == 1
    said = capsys.readouterr()
    assert "new permission: connects by udp (leak)" in said.out
    assert "--allow-more" in said.err
    assert main(["install", str(folder), "--yes", "--allow-more"]) == 1
    assert main(["install", str(folder), "--yes", "--allow-more", RISKS_FLAG]) == 0
    assert [lock.version for lock in store.installed()] == ["1.0.0", "2.0.0", "3.0.0"]
    assert installed_document("drivers/rover") == store.document(store.installed()[0])
    assert installed_document("drivers/rover@3.0.0") == store.document(store.installed()[2])


def test_a_newer_interface_is_used_at_once_and_says_what_it_changes(tmp_path: Path) -> None:
    """There is no choice of versions for it, so it is agreed to like an update."""
    store = stock(tmp_path)
    install(store, package("interface", "wide"))
    newer = package("interface", "wide", "2.0.0").data
    with served(tmp_path) as client:
        body = {"content": newer, "headers": {"content-type": "application/octet-stream"}}
        job = asked(client, "upload?name=wide.zip", **body)
        assert (job["isUpdate"], job["stays"]) == (True, "")
        assert agree(client, job).json()["state"] == "done"


def test_what_a_package_uses_by_itself_is_agreed_to_apart(tmp_path: Path) -> None:
    attack = ATTACK.parent / "key-user"
    with served(tmp_path) as client:
        job = asked(client, "add", json={"path": str(attack)})
        assert "shell logs in with the keys of your SSH agent" in job["risks"]
        refused = agree(client, job)
        assert refused.status_code == 422
        assert "uses files, programs or hosts without a setting" in refused.json()["error"]
        assert agree(client, job, takesRisks=True).json()["state"] == "done"


def test_sockets_look_at_their_rights_after_a_change_of_the_robot(tmp_path: Path) -> None:
    """A grant may be for a tag that the new document lacks."""
    stock(tmp_path)
    looks: list[str] = []
    with served(tmp_path) as client, OPEN.followed(lambda: looks.append("looked")):
        client.get("/")
        looks.clear()
        said = {"settings": {}, "version": "1.0.0", "test": False}
        assert client.post("/api/v1/robots/rover/settings", json=said).json()["isSaved"]
        assert looks
