"""Robots whose extra is not installed: the message of `urc serve`, before a page is opened."""

import sys
from pathlib import Path

import pytest

from urc.cli import dashboard
from urc.cli.main import main
from urc.config.load import load_profile
from urc.runtime.missing_packages import missing_packages
from urc.runtime.registries import built_in_catalog
from urc.runtime.settings import resolve_settings
from urc.transports import mqtt, zenoh
from urc.transports.ros import rosbridge
from urc.transports.ros import zenoh as ros_zenoh
from urc.web.fleet.robots import Robot

ROBOT = """\
urc: 1
kind: robot
name: rover
settings: { place: { type: string, default: PLACE } }
transports:
  wire: { type: TYPE, WHERE: "{{ settings.place }}" }
signals:
  battery: { type: number, unit: "%" }
messages:
  battery: { MATCH, regex: '^(?P<battery>[0-9.]+)$' }
"""
TOPIC = "subscribe: { topic: rover/battery }"


def robot(folder: Path, kind: str, where: str, place: str, match: str) -> Robot:
    """Return a robot with one transport of this kind."""
    text = ROBOT.replace("TYPE", kind).replace("WHERE", where).replace("PLACE", place)
    if not match:
        text = text.replace('}}" }', '}}", framing: { type: delimiter, rx: LF, tx: LF } }')
    text = text.replace("MATCH, ", f"{match}, " if match else "")
    file = folder / "rover.yaml"
    file.write_text(text, "utf-8")
    profile = load_profile(str(file), built_in_catalog())
    settings = resolve_settings(profile, {}, {})[0]
    return Robot(profile, settings, open_session=lambda: pytest.fail("nothing opens the robot"))


def remove(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Let the transport find its library no longer."""
    if kind == "serial":
        monkeypatch.setitem(sys.modules, "serialx", None)
    else:
        monkeypatch.setattr({"mqtt": mqtt, "zenoh": zenoh}[kind], "find_spec", lambda _: None)


KINDS = [
    ("mqtt", "host", "127.0.0.1", TOPIC, "paho-mqtt"),
    ("zenoh", "host", "127.0.0.1", TOPIC, "eclipse-zenoh"),
    ("serial", "port", "/dev/ttyUSB0", "", "serialx"),
]


@pytest.mark.parametrize(("kind", "where", "place", "match", "package"), KINDS)
def test_the_terminal_names_robot_package_and_command(
    kind: str,
    where: str,
    place: str,
    match: str,
    package: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Before the address; nothing is said about an extra that is installed."""
    one = robot(tmp_path, kind, where, place, match)
    dashboard._warn_of_packages(one)
    assert capsys.readouterr().err == ""
    remove(monkeypatch, kind)
    dashboard._warn_of_packages(one)
    said = capsys.readouterr().err
    assert said.startswith(f"urc: rover cannot be opened: {kind} needs the package {package}: ")
    assert f"install '{package}" in said
    assert said.count("\n") == 1


def test_a_missing_value_hides_no_missing_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The value is entered later, on a page of the robot; the package is needed now."""
    one = robot(tmp_path, "serial", "port", '""', "")
    transports = built_in_catalog().transports
    assert missing_packages(one.profile, {}, transports) == ((), ())
    remove(monkeypatch, "serial")
    empty = one.profile._replace(
        settings={
            name: setting._replace(default=None, is_required=True)
            for name, setting in one.profile.settings.items()
        }
    )
    (text,) = missing_packages(empty, {}, transports).needed
    assert text.startswith("serial needs the package serialx: ")


SEVERAL = """\
urc: 1
kind: robot
name: rover
settings: { port: { type: string, default: "" } }
transports:
  door: { type: serial, port: "{{ settings.port }}", framing: { type: delimiter, tx: LF, rx: LF } }
  broker: { type: mqtt, host: 127.0.0.1 }
  bridge: { type: ros, host: 127.0.0.1 }
  bus: { type: ros, via: zenoh, host: 127.0.0.1 }
signals:
  battery: { type: number, unit: "%" }
  eye: { type: image }
messages:
  a: { from: broker, subscribe: { topic: rover/battery }, regex: '^(?P<battery>[0-9.]+)$' }
  b:
    from: bridge
    subscribe: { topic: /eye, type: sensor_msgs/msg/CompressedImage, compression: cbor }
    json: { eye: data }
"""


def test_every_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A transport with another fault hides no later transport."""
    file = tmp_path / "rover.yaml"
    file.write_text(SEVERAL, "utf-8")
    profile = load_profile(str(file), built_in_catalog())
    transports = built_in_catalog().transports
    assert missing_packages(profile, {}, transports) == ((), ())
    for module in (mqtt, ros_zenoh, rosbridge):
        monkeypatch.setattr(module, "find_spec", lambda _: None)
    missing = missing_packages(profile, {}, transports)
    named = [text.partition(":")[0] for text in missing.needed]
    assert named == [
        "mqtt needs the package paho-mqtt",
        "cbor needs the package cbor2",
        "ros over zenoh needs the package eclipse-zenoh",
    ]


def test_validate_names_the_command_but_reports_no_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The document is right, so `--strict` and the formats for machines stay as they are."""
    one = robot(tmp_path, "mqtt", "host", "127.0.0.1", TOPIC)
    remove(monkeypatch, "mqtt")
    assert main(["validate", "--strict", str(one.profile.file)]) == 0
    note, summary = capsys.readouterr().err.splitlines()
    assert note.startswith(f"{one.profile.file} cannot be opened on this computer: mqtt needs ")
    assert "install 'paho-mqtt" in note
    assert summary.startswith("1 document: 0 errors, 0 warnings")
    assert main(["validate", "--format", "json", str(one.profile.file)]) == 0
    assert capsys.readouterr().err == ""


def test_a_broken_installation_is_no_missing_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A package of the core is missing, as `urc doctor` reports; a check of documents goes on."""
    file = tmp_path / "rover.yaml"
    file.write_text(SEVERAL, "utf-8")
    monkeypatch.setitem(sys.modules, "urc.transports.ros.choice", None)
    assert main(["validate", str(file)]) == 0
    assert "cannot be opened" not in capsys.readouterr().err


def test_the_playground_needs_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one = robot(tmp_path, "mqtt", "host", "127.0.0.1", TOPIC)
    remove(monkeypatch, "mqtt")
    monkeypatch.setattr("urc.cli.validate.sys.platform", "emscripten")
    assert main(["validate", str(one.profile.file)]) == 0
    assert capsys.readouterr().err.count("\n") == 1
