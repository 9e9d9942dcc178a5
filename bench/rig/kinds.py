"""The kinds of transport for the rig's robots, with real third-party programs.

Each kind defines the robot's address (see `bench.rig.robot_process`), its document, and limits
after a cut. If a connection reopens immediately, no motion older than 300 ms may arrive, and the
stop must arrive within 100 ms. Kinds that reconnect slowly, or whose lost connection is not
detected, have other limits.
"""

import shutil
import subprocess
from pathlib import Path
from typing import Final, NamedTuple

from bench.rig.programs import SERVER_ADDRESS, Program

__all__ = [
    "KINDS",
    "Bounds",
    "Counterpart",
    "bounds_of",
    "document",
    "place_of",
    "start_counterpart",
]

KINDS: Final = (
    "tcp",
    "telnet",
    "websocket",
    "udp",
    "ssh",
    "serial",
    "mqtt",
    "ros",
    "http",
)
_AT_ONCE: Final = ("tcp", "telnet", "websocket", "http")
FIRST_PORT: Final = {"ssh": 2200, "mqtt": 18830}
"""Port of the first robot's third-party program, by kind; the following robots use the next
ports."""


class Bounds(NamedTuple):
    """Limits that apply to one kind of transport after a cut."""

    oldest_ms: float
    """Largest allowed age of motion when it is received, in ms."""
    most_late: int | None
    """Largest allowed number of motion frames older than 300 ms."""
    stop_ms: float
    """Longest allowed time from the end of the cut to the stop, in ms."""
    unnoticed_s: float
    """Longest cut that may leave a held control unaffected, in seconds."""
    is_told: bool = True
    """Whether URC can detect lost data; if False, even a stop may be lost."""
    is_repeated: bool = False
    """Whether a stop is sent several times."""


def bounds_of(kind: str) -> Bounds:
    """Return the limits for a kind of transport."""
    if kind in _AT_ONCE:
        return Bounds(300.0, 0, 100.0, 0.45)
    if kind == "udp":
        return Bounds(300.0, 0, 100.0, float("inf"), is_told=False, is_repeated=True)
    # Allow one late motion frame, at most a second old, and the fastest possible reconnection.
    return Bounds(1000.0, 1, 1000.0, 1.3, is_repeated=kind != "ssh")


_DOCUMENT = """\
urc: 1
kind: robot
name: robot-{index}
title: Robot {index}
summary: A robot of the rig. It stamps what it hears.
transports:
  wire: {{ {options} }}
commands:
  go:
    send: {send}
    args: {{ t: {{ type: integer, min: 0 }} }}
    hold: {{ repeat: 50ms, lease: 250ms, release: {{ t: 0 }}, watchdog: none }}
{polls}"""
_LINES = "framing: { type: delimiter, tx: LF, rx: LF }"
_TEXT = '"M {{ t }}"'
_OPTIONS: Final = {
    "tcp": "type: tcp, host: HOST, port: PORT, " + _LINES,
    "telnet": "type: telnet, host: HOST, port: PORT, " + _LINES,
    "websocket": 'type: websocket, url: "ws://HOST:PORT/"',
    "udp": "type: udp, host: HOST, port: PORT, framing: { type: datagram }",
    "ssh": (
        'type: ssh, host: HOST, port: OTHER, username: robot, key: "KEY", host_key: "SHOWN", '
        "mode: exec, command: nc 127.0.0.1 PORT, reconnect: { initial: 100ms }, " + _LINES
    ),
    "serial": 'type: serial, port: "socket://HOST:PORT", baud: 115200, ' + _LINES,
    "mqtt": "type: mqtt, host: HOST, port: OTHER",
    "ros": "type: ros, host: HOST, port: PORT, version: 2",
    "http": 'type: http, url: "http://HOST:PORT/"',
}
_SENDS: Final = {
    "mqtt": '{ publish: { topic: go, text: "M {{ t }}" } }',
    "ros": '{ publish: { topic: /go, type: std_msgs/Int64, json: { data: "{{ t }}" } } }',
    "http": '{ request: { path: "/go?t={{ t }}" } }',
}
_ASIDE: Final = {
    "mqtt": "{ publish: { topic: aside, text: here } }",
    "ros": "{ publish: { topic: /aside, type: std_msgs/String, json: { data: here } } }",
}
"""A request whose slow reply delays motion on the same connection."""


class Counterpart(Program):
    """A robot's third-party program, which ends on request or with its parent process."""

    def __init__(self, command: list[str], *, inside: tuple[str, ...], port: int) -> None:
        """Run `command`, and wait until it listens on `port`."""
        self.port = port
        self.options: dict[str, str] = {}
        """Values that replace the placeholders of the robot's document, keyed by placeholder."""
        script = '"$@" & child=$!; cat > /dev/null; kill -9 $child; wait $child'
        # The script kills by force, because unshare ignores other signals.
        super().__init__(["sh", "-c", script, "sh", *command], inside=inside)


def place_of(kind: str, index: int) -> str:
    """Return the address of a robot of this kind, as an argument for `robot_process`."""
    if kind == "mqtt":
        return f"mqtt:127.0.0.1:{FIRST_PORT[kind] + index}"
    if kind == "ssh":
        return "tcp:127.0.0.1:0"
    doors = {"udp": "udp", "websocket": "ws", "ros": "bridge", "http": "http"}
    door = doors.get(kind, "tcp")
    return f"{door}:{SERVER_ADDRESS}:0"


def document(kind: str, index: int, port: int, other: Counterpart | None) -> str:
    """Return the document of a robot at `port`, whose third-party program is `other` or None."""
    options = _OPTIONS[kind].replace("HOST", SERVER_ADDRESS).replace("PORT", str(port))
    if other is not None:
        options = options.replace("OTHER", str(other.port))
        for name, value in other.options.items():
            options = options.replace(name, value)
    aside = _ASIDE.get(kind)
    polls = f"polls:\n  - {{ every: 60ms, send: {aside} }}\n" if aside else ""
    send = _SENDS.get(kind, _TEXT)
    return _DOCUMENT.format(index=index, options=options, send=send, polls=polls)


def start_counterpart(
    kind: str, index: int, folder: Path, inside: tuple[str, ...]
) -> Counterpart | None:
    """Start the third-party program for a robot of this kind.

    Return None for kinds that need no program.
    """
    if kind == "mqtt":
        return _broker(FIRST_PORT[kind] + index, folder / f"broker-{index}.conf", inside)
    if kind == "ssh":
        return _login(FIRST_PORT[kind] + index, folder / f"login-{index}", inside)
    return None


def _broker(port: int, file: Path, inside: tuple[str, ...]) -> Counterpart:
    file.write_text(
        f"listener {port} 0.0.0.0\nallow_anonymous true\nuser root\nset_tcp_nodelay true\n", "utf-8"
    )
    program = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
    return Counterpart([program, "-c", str(file)], inside=inside, port=port)


_USER_ID: Final = 65433
_ENTER: Final = (
    'mount --bind "$1/passwd" /etc/passwd && mount --bind "$1/shadow" /etc/shadow '
    '&& mount --bind "$1" /run/sshd && exec "$2" -D -e -f "$1/sshd_config"'
)


def _login(port: int, folder: Path, inside: tuple[str, ...]) -> Counterpart:
    """Start OpenSSH's server as a separate user, without changing the machine's configuration."""
    folder.mkdir(mode=0o755)
    for name in ("host", "user"):
        make = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / name)]
        subprocess.run(make, check=True, timeout=30)
    users = Path("/etc/passwd").read_text("utf-8")
    home = f"robot:x:{_USER_ID}:{_USER_ID}::/:/bin/sh\n"
    (folder / "passwd").write_text(users + home, "utf-8")
    (folder / "shadow").touch(mode=0o600)
    (folder / "shadow").write_text("root:*:1:0:::::\nrobot:*:1:0:::::\nsshd:*:1:0:::::\n", "utf-8")
    (folder / "sshd_config").write_text(
        f"Port {port}\nListenAddress 0.0.0.0\nHostKey {folder / 'host'}\nStrictModes no\n"
        "AuthorizedKeysFile /run/sshd/user.pub\nUsePAM no\nPidFile none\nMaxStartups 100\n"
        "PrintMotd no\nPrintLastLog no\nLogLevel ERROR\nUseDNS no\n",
        "utf-8",
    )
    Path("/run/sshd").mkdir(mode=0o755, exist_ok=True)  # sshd refuses to start without it
    program = shutil.which("sshd") or "/usr/sbin/sshd"
    command = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", _ENTER, "sh"]
    made = Counterpart([*command, str(folder), program], inside=inside, port=port)
    look = ["ssh-keygen", "-l", "-f", str(folder / "host.pub")]
    shown = subprocess.run(look, check=True, capture_output=True, text=True, timeout=30)
    made.options = {"KEY": str(folder / "user"), "SHOWN": shown.stdout.split()[1]}
    return made
