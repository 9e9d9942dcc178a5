"""Robots with a camera on a computer without the extra `video`."""

from dataclasses import replace
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
from urc.web.fleet.fleet import Fleet
from urc.web.fleet.robots import Robot, RobotService

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
    assert dark_videos(profile, {}, table()) == {"picture"}
    monkeypatch.setattr(camera, "find_spec", lambda _: object())
    assert dark_videos(profile, {}, table()) == frozenset()


async def test_the_settings_decide_which_package_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """WHEP needs a second package. The sample of the setting would need none of them."""
    url = '"{{ settings.eye }}"'
    text = DRONE.replace("WIRE", WIRE).replace('"udp://127.0.0.1:0"', url)
    setting = 'settings: { eye: { type: string, default: "rtsp://10.0.0.2/" } }\ntransports:\n'
    profile = profile_of(tmp_path, text.replace("transports:\n", setting))
    found = {"av": object()}
    monkeypatch.setattr(camera, "find_spec", found.get)
    assert dark_videos(profile, {"eye": "rtsp://10.0.0.9/"}, table()) == frozenset()
    assert dark_videos(profile, {"eye": "whep://10.0.0.9/whep"}, table()) == {"picture"}


class Counted:
    """Counts the questions for the package `av`, which is not installed at first."""

    def __init__(self) -> None:
        self.questions = 0
        self.is_installed = False

    def __call__(self, _: str) -> object | None:
        self.questions += 1
        return self if self.is_installed else None


async def test_a_fleet_looks_again_only_after_a_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    robot = Robot(profile, {}, open_session=lambda: pytest.fail("nothing opens the robot"))
    counted = Counted()
    monkeypatch.setattr(camera, "find_spec", counted)
    ships = Fleet({"drone": robot}, lambda _, one: RobotService(one))
    assert ships.dark_videos("drone") == {"picture"}
    counted.is_installed = True
    assert ships.dark_videos("drone") == frozenset()
    questions = counted.questions
    assert ships.dark_videos("drone") == frozenset()
    assert counted.questions == questions
    counted.is_installed = False
    ships.renew("drone", robot)
    assert ships.dark_videos("drone") == {"picture"}
    ships.renew("drone", replace(robot, playback=Playback()))
    assert ships.dark_videos("drone") == frozenset(), "the recording contains the videos"


class Playback:
    """Of a recording, which is not played here."""

    began_s = length_s = position_s = 0.0
    is_playing, speed = False, 1.0

    def play(self) -> None: ...

    def pause(self) -> None: ...

    def seek(self, position_s: float) -> None: ...


def test_the_terminal_says_in_one_line_that_only_videos_are_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    robot = Robot(profile, {}, open_session=lambda: pytest.fail("nothing opens the robot"))
    other = replace(robot, profile=profile._replace(name="diver"))
    dashboard._warn_of_packages(robot)
    assert capsys.readouterr().err == "", "before the address, only what no page can open"
    dashboard._tell_dark_cameras([robot, other])
    said = capsys.readouterr().err
    assert said.startswith(f"no video of drone, diver: {NAMED}")
    assert said.count("\n") == 1


async def test_the_test_of_the_settings_names_the_package(tmp_path: Path) -> None:
    """Next to the result of the other transports, and without a wait."""
    profile = profile_of(tmp_path, DRONE.replace("WIRE", WIRE))
    found = await probe(lambda: Session(profile, {}, table()), table())
    assert [one.transport for one in found] == ["wire", "eye"]
    assert found[1].verdict == "fails"
    assert found[1].text.startswith(NAMED)
