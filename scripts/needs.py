"""The programs beside Python that the tests use, and how they come onto this machine.

As root they come from apt; the browser also from npm, for those without root. Whatever could not
be brought is returned, never passed over: the summary of ``./dev test`` lists it.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from scripts.chromium.bring import BringError, bring_chromium
from scripts.node import node_executable, playwright_environment

__all__ = ["NEEDS", "Brought", "Need", "bring"]

APT_TIMEOUT_S = 600


@dataclass(frozen=True, slots=True)
class Need:
    """One program: the name tests use in ``needs(...)``, its executables, its Debian package."""

    name: str
    executables: tuple[str, ...]
    """Any one of them will do."""
    package: str
    purpose: str
    variable: str = ""
    """The environment variable that names another executable, if there is one."""
    other: Callable[[], str | None] | None = None
    """Finds it where it is on no path."""

    def find(self) -> str | None:
        """Return what the variable names, else the first executable that is there."""
        named = os.environ.get(self.variable) if self.variable else None
        found = named or next(
            (path for name in self.executables if (path := shutil.which(name))), None
        )
        return found or (self.other() if self.other else None)


# Later tests extend this table; nothing else has to know.
NEEDS = (
    Need(
        name="chromium",
        executables=("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"),
        package="chromium",
        purpose="the browser tests",
        variable="URC_CHROMIUM",
    ),
    Need(
        name="netcat",
        executables=("nc",),
        package="netcat-openbsd",
        purpose="the tests against a client that is not URC",
    ),
    Need(
        name="socat",
        executables=("socat",),
        package="socat",
        purpose="the tests against a server that is not URC",
    ),
    Need(
        name="node",
        executables=("node",),
        package="nodejs",
        purpose="the tests of the schemas in an editor's language server",
        other=node_executable,
    ),
)


@dataclass(slots=True)
class Brought:
    """What the tests are to know about this machine."""

    environment: dict[str, str] = field(default_factory=dict)
    left_out: list[Need] = field(default_factory=list)

    @property
    def remedy(self) -> str:
        """The one command that brings all that was left out."""
        sudo = "" if _is_root() else "sudo "
        return f"{sudo}apt-get install -y {' '.join(need.package for need in self.left_out)}"


def bring() -> Brought:
    """Find or install every need; report what is missing."""
    missing = [need for need in NEEDS if need.find() is None]
    if missing and _is_root() and shutil.which("apt-get"):
        _apt_install([need.package for need in missing])
        missing = [need for need in missing if need.find() is None]
    browser = NEEDS[0].find() or _chromium_from_npm()
    brought = Brought(playwright_environment())
    if browser:
        brought.environment["URC_CHROMIUM"] = browser
    brought.left_out = [need for need in missing if need.name != "chromium" or not browser]
    brought.environment["URC_LEFT_OUT"] = ",".join(need.name for need in brought.left_out)
    return brought


def _chromium_from_npm() -> str | None:
    try:
        return bring_chromium()
    except BringError as error:
        print(f"no browser from npm: {error}", flush=True)
        return None


def _apt_install(packages: list[str]) -> None:
    """Install Debian packages; what fails shows, and is missing afterwards."""
    print(f"installing {' '.join(packages)} ...", flush=True)
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    options = ["-q", "-y", "-o", "Dpkg::Use-Pty=0"]
    for command in (
        ["apt-get", *options, "update"],
        ["apt-get", *options, "install", "--no-install-recommends", *packages],
    ):
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True,
                timeout=APT_TIMEOUT_S, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            print(f"{' '.join(command)}: no end within {APT_TIMEOUT_S} s", flush=True)
            return
        if done.returncode != 0:
            print(f"{' '.join(command)}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}", flush=True)


def _is_root() -> bool:
    return sys.platform != "win32" and os.geteuid() == 0
