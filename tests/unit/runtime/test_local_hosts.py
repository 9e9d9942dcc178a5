"""Which hosts are this machine, and that no package fixes one."""

from pathlib import Path

import pytest

from urc.problems import UrcError
from urc.runtime.local_hosts import check_hosts, is_near
from urc.runtime.open_profile import open_document


@pytest.mark.parametrize(
    ("host", "near"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("127.1", True),
        ("0x7f.1", True),
        ("2130706433", True),
        ("0.0.0.0", True),
        ("localhost", True),
        ("LocalHost.", True),
        ("a.localhost", True),
        ("::1", True),
        ("[::1]", True),
        ("::ffff:127.0.0.1", True),
        ("169.254.3.4", True),
        ("fe80::1%eth0", True),
        ("192.168.1.5", False),
        ("10.0.0.5", False),
        ("2001:db8::7", False),
        ("robot.local", False),
        ("localhost.example.org", False),
        ("robot-pi", False),
    ],
)
def test_every_form_of_this_machine_is_near(host: str, near: bool) -> None:
    assert is_near(host) is near


DOCUMENT = """\
urc: 1
kind: driver
name: near
settings:
  host: {{ type: host }}
  n: {{ type: integer, default: 1 }}
transports:
  jump: {{ type: ssh, mode: forward, host: "{{{{ settings.host }}}}", username: robot }}
  wire: {{ {line} }}
signals:
  n: {{}}
messages:
  any: {{ regex: '^(?P<n>\\d+) {{0}}$' }}
commands:
  ask: {{ to: wire, send: "{{{{ settings.n }}}}" }}
"""
TCP = "type: tcp, port: 80, framing: { type: delimiter, tx: LF, rx: LF }"
WEB = "type: websocket, framing: { type: datagram }"


@pytest.mark.parametrize(
    ("line", "host"),
    [
        (f"{TCP}, host: 127.0.0.1", "127.0.0.1"),
        (f"{TCP}, host: localhost", "localhost"),
        (f"{TCP}, host: \"{{{{ '127.0.' ~ '0.1' }}}}\"", "127.0.0.1"),
        (f'{TCP}, host: "127.0.0.{{{{ settings.n }}}}"', "127.0.0.{{ settings.n }}"),
        (f'{WEB}, url: "ws://[::1]:8080/ws"', "[::1]"),
        (f'{WEB}, url: "ws://169.254.1.2/{{{{ settings.n }}}}"', "169.254.1.2"),
        (f'{TCP}, host: "{{{{ settings.host }}}}"', ""),
        (f"{TCP}, host: 10.0.0.5", ""),
        (f"{TCP}, host: 127.0.0.1, tunnel: jump", ""),
    ],
)
def test_a_package_fixes_no_host_to_this_machine(line: str, host: str, tmp_path: Path) -> None:
    """By a setting, or from behind another machine, it may lead there."""
    file = tmp_path / "near.yaml"
    file.write_text(DOCUMENT.format(line=line), "utf-8")
    profile = open_document(str(file))
    if not host:
        check_hosts(profile)
        return
    with pytest.raises(
        UrcError, match="a package may use this machine only through a setting"
    ) as told:
        check_hosts(profile)
    assert f"the transport wire has the fixed host {host}, which is this machine" in str(told.value)


CAMERA = """
urc: 1
kind: robot
name: eye
transports:
  eye: {{ type: camera, url: "{url}" }}
signals:
  picture: {{ type: video }}
messages:
  picture: {{ raw: picture }}
"""


@pytest.mark.parametrize(
    ("url", "is_fine"),
    [("udp://0.0.0.0:11111", True), ("rtsp://127.0.0.1/", False), ("http://0.0.0.0/", False)],
)
def test_a_package_may_receive_a_video_on_a_port(url: str, is_fine: bool, tmp_path: Path) -> None:
    """A udp URL is where the data arrives, so it leads to no program of this machine."""
    file = tmp_path / "near.yaml"
    file.write_text(CAMERA.format(url=url), "utf-8")
    profile = open_document(str(file))
    if is_fine:
        check_hosts(profile)
        return
    with pytest.raises(UrcError, match="which is this machine"):
        check_hosts(profile)
