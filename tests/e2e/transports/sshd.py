"""OpenSSH's server with users of its own, on a free port of loopback. Needs root.

It runs in namespaces of its own, where /etc/passwd holds a user ``robot`` beside the machine's:
nothing is changed on the machine, and nothing outlives it.
"""

import os
import shutil
import subprocess
from pathlib import Path

from tests.e2e.ports import free_port
from tests.e2e.transports.processes import Server

__all__ = ["PASSWORD", "USER", "Sshd"]

USER, PASSWORD = "robot", "let me in"
_HASHED = (  # by crypt(3)
    "$6$urcurcur$2yDgfhCHzSwP95m.1xiOhM.LPQ3sgFCmjSeTmj"
    "i.AchOfhLjl0xKPg8/GzJnokKSq5JZNe9BzwNHdsUBzegKd."
)
_UID = 65433


class Sshd(Server):
    """One server. `folder` holds all it needs, and what it says."""

    def __init__(self, folder: Path, *, extra: str = "", host_key: Path | None = None) -> None:
        """Prepare a server.

        Args:
            folder: empty, of this test.
            extra: lines of its configuration.
            host_key: a private key; None: a new one of the kind ed25519.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.home = folder / "home"
        self.home.mkdir(mode=0o755, exist_ok=True)
        os.chown(self.home, _UID, _UID)
        self.authorized = folder / "authorized_keys"
        self.authorized.touch()
        self.host_key = host_key or new_key(folder / "host_key")
        port = free_port()
        self._write_users()
        self._write_configuration(port, extra)
        super().__init__(self._start_command(), port, folder / "log.txt")

    @property
    def fingerprint(self) -> str:
        """Of its host key, as OpenSSH itself says it."""
        return fingerprint_of(self.host_key)

    def authorize(self, key: Path) -> None:
        """Let who has the private key in."""
        with self.authorized.open("a", encoding="utf-8") as lines:
            lines.write(key.with_suffix(".pub").read_text("utf-8"))

    def change_host_key(self) -> None:
        """Be another machine from the next start on."""
        self.host_key.unlink()
        new_key(self.host_key)

    def _write_users(self) -> None:
        passwd = Path("/etc/passwd").read_text("utf-8")
        (self.folder / "passwd").write_text(
            f"{passwd}{USER}:x:{_UID}:{_UID}::{self.home}:/bin/sh\n", "utf-8"
        )
        shadow = Path("/etc/shadow").read_text("utf-8")
        (self.folder / "shadow").write_text(f"{shadow}{USER}:{_HASHED}:19000:0:99999:7:::\n")
        (self.folder / "shadow").chmod(0o600)

    def _write_configuration(self, port: int, extra: str) -> None:
        (self.folder / "sshd_config").write_text(
            f"{extra}\n"
            f"Port {port}\nListenAddress 127.0.0.1\nHostKey {self.host_key}\n"
            f"AuthorizedKeysFile {self.authorized}\nStrictModes no\nUsePAM no\n"
            f"PidFile {self.folder / 'pid'}\nAcceptEnv GREETING\nMaxStartups 100\n"
            "LoginGraceTime 20\nPrintMotd no\nPrintLastLog no\nLogLevel VERBOSE\n",
            "utf-8",
        )

    def _start_command(self) -> list[str]:
        # It refuses to start when its folder is not there, and must be called by its whole path.
        Path("/run/sshd").mkdir(mode=0o755, exist_ok=True)
        program = shutil.which("sshd") or "/usr/sbin/sshd"
        script = (
            'mount --bind "$1/passwd" /etc/passwd && mount --bind "$1/shadow" /etc/shadow '
            '&& exec "$2" -D -e -f "$1/sshd_config"'
        )
        return [
            "unshare", "--mount", "--pid", "--fork", "--kill-child",
            "sh", "-c", script, "sh", str(self.folder), program,
        ]  # fmt: skip


def new_key(path: Path, kind: str = "ed25519", passphrase: str = "") -> Path:
    """Make a private key, its public one beside it; return its path."""
    path.with_suffix(".pub").unlink(missing_ok=True)
    subprocess.run(["ssh-keygen", "-q", "-t", kind, "-N", passphrase, "-f", str(path)], check=True)
    made = Path(f"{path}.pub")
    if made != path.with_suffix(".pub"):
        made.rename(path.with_suffix(".pub"))
    return path


def fingerprint_of(key: Path) -> str:
    """Return ``SHA256:…`` of a key, as ssh-keygen prints it."""
    done = subprocess.run(
        ["ssh-keygen", "-l", "-f", str(key.with_suffix(".pub"))],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return done.stdout.split()[1]
