"""A robot whose package gets blocked: stopped first, then disabled, with the reason on the menu."""

import json
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import install, package
from tests.unit.web.test_another_version import DOCUMENT, stock
from tests.unit.web.test_manage_routes import fleet_of, served
from urc.packages.block_store import BlockStore
from urc.packages.blocks import Block, BlockList
from urc.packages.signature import Signer, new_signer
from urc.packages.store import Store
from urc.runtime.open_profile import open_document
from urc.web.manage import block_watch

WHY = "It turns the wrong way."
LINE = f"drivers/rover 1.0.0 is blocked by Anna: {WHY}"
BY = f"URC: {LINE}"


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(block_watch, "_LOOK_S", 0.01)


@pytest.fixture
def anna(tmp_path: Path) -> Signer:
    return new_signer("Anna", tmp_path / "anna.pem")


def know(data: Path, by: Signer, number: int, *blocks: Block) -> None:
    BlockStore(data / "packages").keep(by, number, BlockList("0" * 32, blocks), "test")


def until(is_true: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 10
    while not is_true():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def latched(client: TestClient) -> str:
    found: str = client.get("/api/v1/robots/rover/controls").json().get("latched", "")
    return found


def test_a_parked_robot_is_stopped_and_disabled_until_the_entry_is_withdrawn(
    tmp_path: Path, anna: Signer
) -> None:
    stock(tmp_path)
    with served(tmp_path) as client:
        client.get("/")
        assert latched(client) == ""
        know(tmp_path, anna, 1, Block(WHY, "drivers/rover"))
        until(lambda: "rover" not in fleet_of(client).robots)
        assert client.get("/robots/rover/").status_code == 404
        assert f"Cannot be used: {LINE}" in client.get("/").text
        kept = json.loads((tmp_path / "latches/rover.latch.json").read_bytes())
        assert kept["latched_by"] == BY
        (said,) = client.get("/api/v1/packages?kinds=driver").json()["installed"]
        assert said["fault"] == LINE
    with served(tmp_path) as client:  # after a restart, too
        assert LINE in client.get("/").text
        know(tmp_path, anna, 2)
        until(lambda: "rover" in fleet_of(client).robots)
        assert latched(client) == f"{BY}, before a restart"
        assert "Cannot be used" not in client.get("/").text


def test_a_robot_given_at_the_start_is_disabled_and_enabled_again(
    tmp_path: Path, anna: Signer
) -> None:
    store = stock(tmp_path)
    (lock,) = store.installed()
    with served(tmp_path, open_document(store.document(lock))) as client:
        know(tmp_path, anna, 1, Block(WHY, "drivers/rover", "1.0.0"))
        until(lambda: "rover" in fleet_of(client).broken)
        assert "rover" not in fleet_of(client).robots
        know(tmp_path, anna, 2)
        until(lambda: "rover" in fleet_of(client).robots)
        assert latched(client).startswith(BY)


def test_a_blocked_interface_is_taken_from_a_stopped_robot(tmp_path: Path, anna: Signer) -> None:
    """The robot itself is not blocked: it comes back stopped, without the interface."""
    store = stock(tmp_path)
    install(store, package("interface", "wide"))
    with served(tmp_path) as client:
        client.get("/")
        assert "wide" in fleet_of(client).robots["rover"].profile.interfaces
        know(tmp_path, anna, 1, Block(WHY, "interfaces/wide"))
        until(lambda: latched(client).startswith("URC: interfaces/wide 1.0.0 is blocked by Anna"))
        # The stop comes first, and the interface goes after it.
        until(
            lambda: (
                "rover" in (robots := fleet_of(client).robots)
                and "wide" not in robots["rover"].profile.interfaces
            )
        )
        assert client.get("/robots/rover/").status_code in (200, 303)


def test_other_robots_are_not_disturbed(tmp_path: Path, anna: Signer) -> None:
    store = stock(tmp_path)
    install(store, package("driver", "other", text=DOCUMENT))
    with served(tmp_path) as client:
        client.get("/")
        service = fleet_of(client).services["other"]
        know(tmp_path, anna, 1, Block(WHY, "drivers/rover"))
        until(lambda: "rover" not in fleet_of(client).robots)
        assert fleet_of(client).services["other"] is service
        assert service.controls.controller.lease.state.latched_by == ""


def test_a_damaged_file_of_lists_changes_no_running_robot(tmp_path: Path) -> None:
    """Nobody has said that the robot is dangerous; new uses are refused."""
    store = stock(tmp_path)
    (lock,) = Store(tmp_path / "packages").installed()
    with served(tmp_path) as client:
        client.get("/")
        (tmp_path / "packages/blocks.json").write_bytes(b"{")
        time.sleep(0.2)
        assert "rover" in fleet_of(client).robots
        assert latched(client) == ""
        with pytest.raises(Exception, match="this file is damaged"):
            store.document(lock)
