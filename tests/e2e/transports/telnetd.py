"""inetutils' Telnet server on a free port of loopback, with a program as its robot. Needs root."""

import shutil
from pathlib import Path

from tests.e2e.ports import free_port
from tests.e2e.transports.processes import Server

__all__ = ["ROBOT", "Telnetd"]

ROBOT = """#!/bin/sh
# Says what it hears, counts it in a file, and knows one question.
printf 'robot ready\\n> '
while IFS= read -r line; do
    printf '%s\\n' "$line" >> '{heard}'
    case "$line" in
        battery) printf 'battery 42\\n> ' ;;
        *) printf 'heard %s\\n> ' "$line" ;;
    esac
done
"""


class Telnetd(Server):
    """One server; each connection runs the program anew."""

    def __init__(self, folder: Path) -> None:
        """Prepare a server whose files are in `folder`."""
        folder.mkdir(parents=True, exist_ok=True)
        self._heard = folder / "heard"
        program = folder / "robot"
        program.write_text(ROBOT.replace("{heard}", str(self._heard)), "ascii")
        program.chmod(0o755)
        port = free_port()
        server = shutil.which("telnetd", path="/usr/sbin:/usr/bin") or "telnetd"
        command = [
            "socat",
            f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork",
            f"EXEC:{server} -h -E {program},nofork",
        ]
        super().__init__(command, port, folder / "log.txt")

    @property
    def heard(self) -> list[str]:
        """Every line that any connection has brought to the robot, in order."""
        return self._heard.read_text("ascii").splitlines() if self._heard.exists() else []
