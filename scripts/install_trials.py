"""Install URC in new root file systems of Debian by each documented way, and print a table.

    python -m scripts.install_trials FOLDER bookworm trixie

The command needs root, debootstrap, a network, and the wheel of `./dev release` in dist/. It keeps
one new root file system for each Debian release in FOLDER, and copies it for each trial. A trial
fails unless a robot's page is served at its end. The rows are those of docs/install/index.md.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from urc import __version__

__all__ = ["TRIALS", "Trial", "main", "row"]

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
WHEEL = f"urc-{__version__}-py3-none-any.whl"
PACKAGES = "python3,python3-venv,ca-certificates"
CERTIFICATES = Path("etc/ssl/certs/ca-certificates.crt")
_TRIAL_S = 1200
_INSTALLERS = ("pip", "setuptools", "pkg_resources", "_distutils_hack")


class Trial(NamedTuple):
    """One way to install URC."""

    name: str
    install: str
    """Shell commands that install URC; only these are measured. The wheel is in the home folder,
    and the wheels of all other packages are in its folder `wheels`."""
    urc: str
    """Command that starts the installed URC."""
    measured: str
    """Folders of the installed files, whose sizes are added, without pip and setuptools."""
    prepare: str = ""
    """Shell commands before the installation, which are not measured."""
    has_network: bool = False


def _pip(extra: str) -> str:
    return f"python3 -m venv v && v/bin/pip install -q --no-index --find-links wheels 'urc{extra}'"


_FILE = f"./{WHEEL}[demo]"
TRIALS = (
    Trial(
        "[three commands](#try-urc), extra `demo`",
        f"python3 -m venv urc && urc/bin/pip install -q './{WHEEL}[demo]'",
        "urc/bin/urc",
        "urc",
        has_network=True,
    ),
    Trial("pip, without extras", _pip(""), "v/bin/urc", "v/lib"),
    Trial("pip, extra `demo`", _pip("[demo]"), "v/bin/urc", "v/lib"),
    Trial("pip, extra `all`", _pip("[all]"), "v/bin/urc", "v/lib"),
    Trial(
        "pipx, extra `demo`",
        f"pipx install --pip-args \"--no-index --find-links $PWD/wheels\" '{_FILE}'",
        ".local/bin/urc",
        ".local/pipx .local/share/pipx",
        prepare="apt-get update -qq && apt-get install -y -qq --no-install-recommends pipx",
        has_network=True,
    ),
    Trial(
        "uv, extra `demo`",
        f"u/bin/uv tool install -q --no-index --find-links wheels '{_FILE}'",
        ".local/bin/urc",
        ".local/share/uv/tools",
        prepare="python3 -m venv u && u/bin/pip install -q uv",
        has_network=True,
    ),
)

_SERVED = """
import http.cookiejar, re, subprocess, sys, urllib.request
demo = subprocess.Popen([sys.argv[1], "demo", "--no-browser"], stdout=subprocess.PIPE, text=True)
try:
    address = re.search(r"http://[^ ]+", demo.stdout.readline())[0]
    keep = urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar())
    opener = urllib.request.build_opener(keep)
    opener.open(address, timeout=60).read()
    page = opener.open(address.split("?")[0] + "robots/turtlebot4/", timeout=60).read().decode()
    sys.exit("STOP" not in page)
finally:
    demo.terminate()
    demo.wait()
"""
"""Program that starts the demo, and fails unless a robot's page has a STOP button."""

_INSIDE = """
mount -t proc proc "$1/proc" && mount --rbind /dev "$1/dev" && mount -t tmpfs run "$1/run"
exec chroot "$1" env -i HOME=/root LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin \
  sh -ec 'cd /root; python3 - <<END
import fcntl, socket, struct
fcntl.ioctl(socket.socket(), 0x8914, struct.pack("16sh", b"lo", 0x41)) # the loopback interface up
END
eval "$0"' "$2"
"""


def main() -> int:
    """Run all trials; return 1 if one fails."""
    parser = argparse.ArgumentParser(prog="python -m scripts.install_trials")
    parser.add_argument("folder", type=Path, help="folder for the root file systems")
    parser.add_argument("releases", nargs="+", help="such as bookworm")
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="trials whose names contain TEXT"
    )
    options = parser.parse_args()
    if os.geteuid() != 0 or shutil.which("debootstrap") is None:
        parser.error("needs root and the program debootstrap")
    if not (DIST / WHEEL).is_file():
        parser.error(f"dist/{WHEEL} is missing: run ./dev release first")
    code = 0
    for release in options.releases:
        base = new_root(options.folder.resolve(), release)
        for trial in (one for one in TRIALS if options.only in one.name):
            line = row(base, trial)
            code |= line is None
            print(line or f"| {trial.name} | failed, see above | |", flush=True)
    return int(code)


def new_root(folder: Path, release: str) -> Path:
    """Return a new root file system of a Debian release, with the wheels of all packages."""
    base = folder / release
    if (base / "root" / "wheels").is_dir():
        return base
    folder.mkdir(parents=True, exist_ok=True)
    command = ["debootstrap", "--variant=minbase", f"--include={PACKAGES}", release, str(base)]
    subprocess.run(command, check=True, stdout=sys.stderr)
    # Certificates of this computer, because some networks have an authority of their own.
    shutil.copy("/" / CERTIFICATES, base / CERTIFICATES)
    shutil.copy(DIST / WHEEL, base / "root")
    (base / "root" / "served.py").write_text(_SERVED, "utf-8")
    inside(
        base, f"python3 -m venv v && v/bin/pip download -q -d wheels './{WHEEL}[all]' && rm -r v"
    )
    return base


def row(base: Path, trial: Trial) -> str | None:
    """Return a trial's row of the table, or None if the trial failed."""
    root = base.with_name("trial")
    shutil.rmtree(root, ignore_errors=True)
    subprocess.run(["cp", "-a", str(base), str(root)], check=True)
    try:
        inside(root, trial.prepare or "true")
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        inside(root, trial.install, has_network=trial.has_network)
        elapsed = time.monotonic() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        paths = " ".join(f"-not -path '*/site-packages/{name}*'" for name in _INSTALLERS)
        size = f"find {trial.measured} -type f {paths} -printf '%s\\n' 2>/dev/null > sizes || true"
        inside(root, f"{size}; python3 served.py {trial.urc}", has_network=False)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        megabytes = sum(map(int, (root / "root" / "sizes").read_text().split())) / 1e6
    except subprocess.SubprocessError as error:
        print(f"{base.name}: {trial.name}: {error}", file=sys.stderr)
        return None
    finally:
        shutil.rmtree(root, ignore_errors=True)
    return f"| {trial.name}, {base.name} | {elapsed:.0f} s ({used:.0f} s) | {megabytes:.0f} MB |"


def inside(root: Path, command: str, *, has_network: bool = True) -> None:
    """Run a shell command in a root file system, with its own mounts and processes.

    Raises:
        subprocess.SubprocessError: the command failed or took too long.
    """
    for name in ("resolv.conf", "hosts"):
        shutil.copy(f"/etc/{name}", root / "etc")
    spaces = ["--mount", "--pid", "--fork", "--kill-child", *([] if has_network else ["--net"])]
    subprocess.run(
        ["unshare", *spaces, "sh", "-ec", _INSIDE, "sh", str(root), command],
        check=True,
        timeout=_TRIAL_S,
        stdout=sys.stderr,
    )


if __name__ == "__main__":
    sys.exit(main())
