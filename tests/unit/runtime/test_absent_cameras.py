"""Robots with a camera on a computer without the extra `video`."""

from pathlib import Path

import pytest

from urc.cli import dashboard
from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.registry import Table
from urc.runtime.missing_packages import dark_videos, missing_packages
from urc.runtime.probe import probe
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Motion, Session
from urc.testing.transport import MemoryTransport
from urc.transports import camera
from urc.transports.base import MissingPackage, TransportSetup
from urc.web.fleet.robots import Robot

pytestmark = pytest.mark.anyio

DRONE = """
urc: 1
kind: robot
name: drone
transports:
  WIREeye: { type: camera, url: "udp://127.0.0.1:0" }
signals:
  x: { unit: m }
  picture: { type: video }
messages:
  picture: { from: eye, raw: picture }
"""
WIRE = """wire:
    type: tcp
    host: 127.0.0.1
    port: 9
    framing: { type: delimiter, tx: LF, rx: LF }
  """
MOVES = """
commands:
  go: { to: wire, send: go, args: { v: { default: 0 } }, hold: { repeat: 50ms, release: { v: 0 } } }
"""
NAMED = "camera needs the package av: "


@pytest.fixture(autouse=True)
def without_av(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "find_spec", lambda _: None)


def profile_of(folder: Path, text: str) -> Profile:
    file = folder / "drone.yaml"
    file.write_text(text.replace(":0", ":5004"), "utf-8")
    return load_profile(file, built_in_catalog())


def memory(setup: TransportSetup) -> MemoryTransport:
    """Return a line to a robot that says nothing."""
    return MemoryTransport()


def table() -> Table:
    cameras = "urc.transports.camera:from_setup"
    return Table("urc.transports", {"tcp": f"{__name__}:memory", "camera": cameras})


@pytest.mark.parametrize("motion", ["none", "here"])
async def test_a_session_leaves_the_camera_out_and_its_log_says_why(
    motion: Motion, tmp_path: Path
) -> None:
    """No link: a lost one would hide the state of the others."""
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE) + MOVES)
    async with Session(profile, {}, table(), motion=motion) as session:
        assert set(session.hub.links) <= {"wire"}
        (entry,) = session.hub.notes
        assert (entry.level, entry.place) == ("warning", "eye")
        assert entry.text.startswith(NAMED)
        assert "\n" not in entry.text


async def test_a_robot_of_cameras_alone_needs_the_package(tmp_path: Path) -> None:
    profile = profile_of(tmp_path, DRONE.replace("WIRE", ""))
    with pytest.raises(MissingPackage) as told:
        Session(profile, {}, table())
    assert str(told.value).startswith(NAMED)
    (needed,) = missing_packages(profile, {}, table()).needed
    assert needed.startswith(NAMED)


def test_only_the_videos_of_cameras_without_a_package_stay_dark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    assert dark_videos(profile, table()) == {"picture"}
    monkeypatch.setattr(camera, "find_spec", lambda _: object())
    assert dark_videos(profile, table()) == frozenset()


def test_the_terminal_says_that_only_the_video_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    robot = Robot(profile, {}, open_session=lambda: pytest.fail("nothing opens the robot"))
    dashboard._warn_of_packages(robot)
    said = capsys.readouterr().err
    assert said.startswith(f"urc: drone shows no video: {NAMED}")
    assert said.count("\n") == 1


async def test_the_test_of_the_settings_names_the_package(tmp_path: Path) -> None:
    """Next to the result of the other transports, and without a wait."""
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    found = await probe(lambda: Session(profile, {}, table()), table())
    assert [one.transport for one in found] == ["wire", "eye"]
    assert found[1].verdict == "fails"
    assert found[1].text.startswith(NAMED)
