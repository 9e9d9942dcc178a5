"""Robots whose extra is not installed: the message of `urc serve`, before a page is opened."""

import sys
from pathlib import Path

import pytest

from urc.cli import dashboard
from urc.config.load import load_profile
from urc.runtime.missing_packages import missing_package
from urc.runtime.registries import built_in_catalog
from urc.runtime.settings import resolve_settings
from urc.transports import mqtt, zenoh
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
    dashboard._warn_of_package(one)
    assert capsys.readouterr().err == ""
    remove(monkeypatch, kind)
    dashboard._warn_of_package(one)
    said = capsys.readouterr().err
    assert said.startswith(f"urc: rover cannot be opened: {kind} needs the package {package}: ")
    assert f"install '{package}" in said
    assert said.count("\n") == 1


def test_values_that_an_operator_fills_in_later_are_no_missing_package(tmp_path: Path) -> None:
    """A page of the robot asks for them."""
    one = robot(tmp_path, "serial", "port", '""', "")
    assert missing_package(one.profile, one.settings, built_in_catalog().transports) == ""
