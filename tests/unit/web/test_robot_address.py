"""What a robot's card says about its connection, without connecting."""

from pathlib import Path
from typing import NoReturn

import pytest

from urc.runtime.open_profile import open_document
from urc.web.fleet.robots import Robot
from urc.web.show.robot_address import robot_address

ROBOT = """\
urc: 1
kind: robot
name: rover
settings:
  host: {{ type: host, default: 10.0.0.5 }}
  port: {{ type: port, required: false }}
  key: {{ type: string, secret: true, required: false }}
transports:
{transports}
signals: {{ charge: {{ type: integer }} }}
"""
TCP = """\
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, rx: LF, tx: LF }
"""
HTTP = '  web: { type: http, url: "http://ann:open@robot.lan:81/x?key={{ settings.key }}" }\n'
USER = '  web: { type: http, url: "http://ann:open@robot.lan:81/x?key=1" }\n'
SERIAL = """\
  wire:
    type: serial
    port: /dev/ttyUSB0
    baud: 9600
    framing: { type: delimiter, rx: LF, tx: LF }
"""
TUNNEL = """\
  shell:
    type: tcp
    tunnel: login
    host: 127.0.0.1
    port: 23
    framing: { type: delimiter, rx: LF, tx: LF }
  login:
    type: ssh
    host: robot.lan
    username: pi
    password: "{{ settings.key }}"
    framing: { type: delimiter, rx: LF, tx: LF }
"""


def unopened() -> NoReturn:
    """Fail, because the menu connects to no robot."""
    raise AssertionError("a session was opened")


def robot(tmp_path: Path, transports: str, *, is_emulated: bool = False, **more: int) -> Robot:
    """Return a robot with the given transports and settings."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROBOT.format(transports=transports), encoding="utf-8")
    profile = open_document(file)
    settings = {name: one.default for name, one in profile.settings.items()}
    settings |= {"host": "10.0.0.5", "key": "sesame", **more}
    return Robot(profile, settings, unopened, is_emulated=is_emulated)


@pytest.mark.parametrize(
    ("transports", "text"),
    [
        (TCP, "TCP 10.0.0.5:6789"),
        (TCP.replace("{{ settings.host }}", "fe80::1"), "TCP [fe80::1]:6789"),
        (SERIAL, "Serial /dev/ttyUSB0"),
        (HTTP, "HTTP"),
        (USER, "HTTP robot.lan:81"),
        (TUNNEL, "SSH robot.lan"),
    ],
)
def test_the_card_names_the_kind_and_the_place(tmp_path: Path, transports: str, text: str) -> None:
    """Never a secret, a user or a query; through a tunnel, the place of its outer end."""
    assert robot_address(robot(tmp_path, transports, port=6789)) == text


def test_an_emulated_robot_has_no_address(tmp_path: Path) -> None:
    """URC does not connect to the address in its settings."""
    assert robot_address(robot(tmp_path, TCP, is_emulated=True, port=6789)) == "TCP"
