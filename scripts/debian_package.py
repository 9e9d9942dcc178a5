"""Build the Debian package with debhelper from a folder of wheels, for `./dev release --debian`.

This script must run on the package's target Debian release, because the package contains a virtual
environment of that release's Python. The script needs the packages `build-essential`,
`debhelper` and `python3-venv`, but no network.

    python -m scripts.debian_package RELEASE WHEELS
"""

import os
import re
import shutil
import subprocess
import sys
from email.utils import formatdate
from pathlib import Path
from tempfile import TemporaryDirectory

from urc import __version__

__all__ = ["build_package", "lay_out"]

ROOT = Path(__file__).resolve().parents[1]
TEMPLATE = ROOT / "packaging" / "debian"
SERVICE = ROOT / "docs" / "urc.service"
IN_PACKAGE = "/usr/bin/urc"
_BUILD_S = 1800


def lay_out(source: Path, release: Path, wheels: Path, epoch: int) -> None:
    """Fill the folder `source` with all files that dpkg-buildpackage needs.

    Args:
        source: an empty folder.
        release: folder of the release, which contains the wheel, manual page, completions and
            notices.
        wheels: folder with the wheels of all packages that URC needs.
        epoch: release time, in seconds since the epoch.
    """
    debian = source / "debian"
    shutil.copytree(TEMPLATE, debian)
    (debian / "source").mkdir()
    (debian / "source" / "format").write_text("3.0 (native)\n", "utf-8")
    who = re.search(r"^Maintainer: (.+)$", (debian / "control").read_text("utf-8"), re.M)
    if who is None:
        raise SystemExit("release: packaging/debian/control has no maintainer")
    (debian / "changelog").write_text(
        f"urc ({__version__}) unstable; urgency=medium\n\n  * See CHANGELOG.md.\n\n"
        f" -- {who[1]}  {formatdate(epoch)}\n",
        "utf-8",
    )
    (debian / "urc.service").write_text(packaged_service(), "utf-8")
    shutil.copytree(wheels, source / "wheels")
    for wheel in release.glob("*.whl"):
        shutil.copy(wheel, source / "wheels")
    shutil.copytree(release / "completions", source / "completions")
    for path in (*release.glob("*.txt"), release / "urc.1", ROOT / "LICENSE", ROOT / "SECURITY.md"):
        shutil.copy(path, source)


def packaged_service() -> str:
    """Return the systemd unit for the packaged `urc`, without the manual installation steps."""
    text = SERVICE.read_text("utf-8")
    text = re.sub(r"(?m)^ExecStart=\S+", f"ExecStart={IN_PACKAGE}", text)
    return text[text.index("[Unit]") :]


def build_package(release: Path, wheels: Path, epoch: int) -> Path:
    """Build the package in the release's folder; return the package's path.

    Raises:
        SystemExit: a program is missing, or the build failed.
    """
    if shutil.which("dpkg-buildpackage") is None or shutil.which("dh") is None:
        raise SystemExit(
            "release: building the Debian package needs debhelper and build-essential;"
            " run 'apt-get install build-essential debhelper python3-venv'"
        )
    with TemporaryDirectory(prefix="urc-debian-") as folder:
        source = Path(folder, f"urc-{__version__}")
        source.mkdir()
        lay_out(source, release, wheels, epoch)
        command = ["dpkg-buildpackage", "--build=binary", "--no-sign", "--no-pre-clean"]
        environment = os.environ | {"SOURCE_DATE_EPOCH": str(epoch)}
        done = subprocess.run(command, cwd=source, env=environment, timeout=_BUILD_S, check=False)
        if done.returncode != 0:
            raise SystemExit("release: dpkg-buildpackage failed (see above)")
        (made,) = Path(folder).glob("urc_*.deb")
        return Path(shutil.copy(made, release))


if __name__ == "__main__":
    print(build_package(Path(sys.argv[1]), Path(sys.argv[2]), int(os.environ["SOURCE_DATE_EPOCH"])))
