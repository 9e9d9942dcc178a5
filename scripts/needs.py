"""Find and install the programs that the tests need besides Python.

With root access, apt installs the programs. Without root access, the script installs only a
browser, from npm. The summary of ``./dev test`` lists all missing programs.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scripts.chromium.bring import BringError, bring_chromium
from scripts.node import node_executable, playwright_environment

__all__ = ["AXE", "NEEDS", "Brought", "Need", "bring", "faketime_library"]

APT_TIMEOUT_S = 600
ROSLIB = Path(__file__).resolve().parents[1] / "node_modules" / "roslib"
AXE = Path(__file__).resolve().parents[1] / "node_modules" / "axe-core" / "axe.min.js"
ROSMSG = Path(__file__).resolve().parents[1] / "node_modules" / "@foxglove"
ONVIF = Path(__file__).resolve().parents[1] / "node_modules" / "onvif"
WS_PROTOCOL = ROSMSG / "ws-protocol"
PUPPETEER = Path(__file__).resolve().parents[1] / "node_modules" / "puppeteer-core"
PYODIDE = Path(__file__).resolve().parents[1] / "node_modules" / "pyodide"
LANGUAGE_SERVER = (
    Path(__file__).resolve().parents[1]
    / "node_modules"
    / "yaml-language-server"
    / "bin"
    / "yaml-language-server"
)
_SYSTEM_PATH = f"{os.environ.get('PATH', os.defpath)}{os.pathsep}/usr/sbin{os.pathsep}/sbin"
"""Search path with the folders of server programs; by default, only root's `PATH` has them."""


def _rtsp_server() -> Iterator[str]:
    """Yield the RTSP server's library if its encoder and its language binding are there too."""
    parts = ("gstreamer-1.0/libgstx264.so", "girepository-1.0/GstRtspServer-1.0.typelib")
    for folder in Path("/usr/lib").glob("*-linux-*"):
        found = [folder / part for part in parts]
        if (
            all(one.is_file() for one in found)
            and Path("/usr/lib/python3/dist-packages/gi").is_dir()
        ):
            yield os.fspath(found[-1])


def faketime_library() -> str | None:
    """Return the library that gives a program with threads another time of day, or None."""
    found = Path("/usr/lib").glob("*-linux-*/faketime/libfaketimeMT.so.1")
    return next(map(os.fspath, found), None)


@dataclass(frozen=True, slots=True)
class Need:
    """A program that tests need, with its executables, package and purpose."""

    name: str
    executables: tuple[str, ...]
    """Executable names; the program is present if one of them is found."""
    package: str
    """Debian packages, separated by spaces; "" if npm installs the program."""
    purpose: str
    variable: str = ""
    """Environment variable that overrides the executable's path; "" for no variable."""
    other: Callable[[], str | None] | None = None
    """Function that returns the path of a program outside the search path, or None."""
    is_of_root: bool = False
    """Whether only root can use the program; if so, installing it does not help other users."""

    @property
    def is_of_npm(self) -> bool:
        """Whether `npm ci` installs the program."""
        return not self.package and not self.is_of_root

    def find(self) -> str | None:
        """Return the program's path, from the environment variable or the search path, or None."""
        named = os.environ.get(self.variable) if self.variable else None
        found = named or next(
            (path for name in self.executables if (path := shutil.which(name))), None
        )
        return found or (self.other() if self.other else None)


# The only table of needs: add a program for a new test here.
NEEDS = (
    Need(
        name="chromium",
        executables=("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"),
        package="chromium",
        purpose="tests of framed pages, tests of sensors, and benchmarks",
        variable="URC_CHROMIUM",
    ),
    Need(
        # This is the same browser without windows; it needs half the time to show a page. The
        # complete browser is the fallback.
        name="headless-shell",
        executables=("chromium-headless-shell", "chrome-headless-shell"),
        package="chromium-headless-shell",
        purpose="tests in a browser",
        variable="URC_HEADLESS_SHELL",
    ),
    Need(
        name="firefox",
        executables=("firefox-esr", "firefox"),
        package="firefox-esr",
        purpose="tests of the pages in Firefox",
        variable="URC_FIREFOX",
    ),
    Need(
        name="webkit-driver",
        executables=("WebKitWebDriver",),
        package="webkit2gtk-driver",
        purpose="tests of the pages in WebKit",
    ),
    Need(
        # WebKitGTK's browser cannot run without a window.
        name="xvfb",
        executables=("Xvfb",),
        package="xvfb",
        purpose="tests of the pages in WebKit",
    ),
    Need(
        name="zsh",
        executables=("zsh",),
        package="zsh",
        purpose="tests of completion in zsh",
    ),
    Need(
        name="fish",
        executables=("fish",),
        package="fish",
        purpose="tests of completion in fish",
    ),
    Need(
        name="netcat",
        executables=("nc",),
        package="netcat-openbsd",
        purpose="tests with netcat as the client",
    ),
    Need(
        name="socat",
        executables=("socat",),
        package="socat",
        purpose="tests with socat as the server",
    ),
    Need(
        name="iptables",
        executables=(),
        package="iptables",
        purpose="tests of a robot that vanishes without closing its connection, as root only",
        other=lambda: shutil.which("iptables") if _is_root() else None,
    ),
    Need(
        name="tun",
        executables=(),
        package="",
        purpose="tests with a cut link between network namespaces, as root only",
        other=lambda: "/dev/net/tun" if _is_root() and os.access("/dev/net/tun", os.W_OK) else None,
        is_of_root=True,
    ),
    Need(
        name="tmpfs",
        executables=(),
        package="mount",
        purpose="tests of a full disk, as root only",
        other=lambda: shutil.which("mount", path=_SYSTEM_PATH) if _is_root() else None,
    ),
    Need(
        name="netns",
        executables=(),
        package="iproute2",
        purpose="tests of a robot with fixed ports, as root only",
        other=lambda: shutil.which("ip", path=_SYSTEM_PATH) if _is_root() else None,
    ),
    Need(
        name="faketime",
        executables=(),
        package="faketime",
        purpose="tests of servers with a wrong clock",
        other=faketime_library,
    ),
    Need(
        name="ser2net",
        executables=("ser2net",),
        package="ser2net",
        purpose="tests of serial ports over the network",
    ),
    Need(
        name="curl",
        executables=("curl",),
        package="curl",
        purpose="tests of the emulated web server with a third-party client",
    ),
    Need(
        name="openssl",
        executables=("openssl",),
        package="openssl",
        purpose="tests of https against a third-party server",
    ),
    Need(
        name="certutil",
        executables=("certutil",),
        package="libnss3-tools",
        purpose="tests of a browser that trusts the server's own authority",
    ),
    Need(
        name="ffmpeg",
        executables=("ffmpeg",),
        package="ffmpeg",
        purpose="tests of camera streams",
    ),
    Need(
        name="rtsp-server",
        executables=(),
        package="gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-ugly python3-gi",
        purpose="tests of cameras against GStreamer's RTSP server",
        other=lambda: next(_rtsp_server(), None),
    ),
    Need(
        name="lighttpd",
        executables=("lighttpd", "/usr/sbin/lighttpd"),
        package="lighttpd",
        purpose="tests against a third-party web server",
    ),
    Need(
        name="nginx",
        executables=("nginx", "/usr/sbin/nginx"),
        package="nginx-light",
        purpose="a test of URC behind a third-party web server",
    ),
    Need(
        name="prometheus",
        executables=("prometheus",),
        package="prometheus",
        purpose="a test of metrics",
    ),
    Need(
        name="websocketd",
        executables=("websocketd",),
        package="websocketd",
        purpose="tests against a third-party WebSocket server",
    ),
    Need(
        name="gpsd",
        executables=("gpsd", "/usr/sbin/gpsd"),
        package="gpsd",
        purpose="tests against the GPS service",
    ),
    Need(
        name="mosquitto",
        executables=("mosquitto", "/usr/sbin/mosquitto"),
        package="mosquitto",
        purpose="tests against an MQTT broker",
    ),
    Need(
        name="mosquitto-clients",
        executables=("mosquitto_pub",),
        package="mosquitto-clients",
        purpose="tests against third-party MQTT clients",
    ),
    Need(
        name="roscore",
        executables=("/usr/bin/rosmaster",),
        package="ros-core python3-nav-msgs python3-geometry-msgs",
        purpose="tests with a real ROS 1 master",
    ),
    Need(
        name="sshd",
        executables=(),
        package="openssh-server",
        purpose="tests against OpenSSH's server with extra users, as root only",
        other=lambda: shutil.which("sshd", path=_SYSTEM_PATH) if _is_root() else None,
    ),
    Need(
        name="ssh",
        executables=("ssh",),
        package="openssh-client",
        purpose="tests of the emulated SSH server against OpenSSH's client",
    ),
    Need(
        name="telnetd",
        executables=(),
        package="inetutils-telnetd",
        purpose="tests against a third-party Telnet server, as root only",
        other=lambda: shutil.which("telnetd", path=_SYSTEM_PATH) if _is_root() else None,
    ),
    Need(
        name="telnet",
        executables=("telnet",),
        package="inetutils-telnet",
        purpose="tests of the emulated Telnet server against Debian's client",
    ),
    Need(
        name="node",
        executables=("node",),
        package="nodejs",
        purpose="tests of the schemas in an editor's language server",
        other=node_executable,
    ),
    Need(
        name="language-server",
        executables=(),
        package="",
        purpose="tests of the schemas in an editor's language server",
        other=lambda: os.fspath(LANGUAGE_SERVER) if LANGUAGE_SERVER.is_file() else None,
    ),
    Need(
        name="roslib",
        executables=(),
        package="",
        purpose="tests of the emulated rosbridge against its browser client, roslib",
        other=lambda: os.fspath(ROSLIB) if ROSLIB.is_dir() else None,
    ),
    Need(
        name="rosmsg",
        executables=(),
        package="",
        purpose="tests of ROS messages against Foxglove's message reader",
        other=lambda: os.fspath(ROSMSG) if ROSMSG.is_dir() else None,
    ),
    Need(
        name="onvif",
        executables=(),
        package="",
        purpose="tests of the ONVIF profile against another client",
        other=lambda: os.fspath(ONVIF) if ONVIF.is_dir() else None,
    ),
    Need(
        name="ws-protocol",
        executables=(),
        package="",
        purpose="tests of the Foxglove server against Foxglove's client and message schemas",
        other=lambda: os.fspath(WS_PROTOCOL) if WS_PROTOCOL.is_dir() else None,
    ),
    Need(
        name="axe",
        executables=(),
        package="",
        purpose="tests of the pages' accessibility",
        other=lambda: os.fspath(AXE) if AXE.is_file() else None,
    ),
    Need(
        name="puppeteer",
        executables=(),
        package="",
        purpose="tests of the pages in Firefox",
        other=lambda: os.fspath(PUPPETEER) if PUPPETEER.is_dir() else None,
    ),
    Need(
        name="pyodide",
        executables=(),
        package="",
        purpose="tests of the playground",
        other=lambda: os.fspath(PYODIDE) if PYODIDE.is_dir() else None,
    ),
)


@dataclass(slots=True)
class Brought:
    """Result of an installation: environment variables for tests, and programs still missing."""

    environment: dict[str, str] = field(default_factory=dict)
    left_out: list[Need] = field(default_factory=list)

    @property
    def remedy(self) -> str:
        """The command that installs all missing programs."""
        sudo = "" if _is_root() else "sudo "
        packages = [need.package for need in self.left_out if need.package]
        commands = [f"{sudo}apt-get install -y {' '.join(packages)}"] if packages else []
        if any(need.is_of_npm for need in self.left_out):
            commands.append("npm ci --ignore-scripts")
        if not commands and self.left_out:
            return "sudo ./dev test"
        return " && ".join(commands)

    def look_again(self) -> None:
        """Search for the missing programs again after an installation."""
        self.left_out = [need for need in self.left_out if need.find() is None]
        self.environment["URC_LEFT_OUT"] = ",".join(need.name for need in self.left_out)


def bring(needs: Sequence[Need] = NEEDS) -> Brought:
    """Find or install each required program; report missing programs."""
    missing = [need for need in needs if need.find() is None]
    if any(need.package for need in missing) and _is_root() and shutil.which("apt-get"):
        _apt_install([name for need in missing for name in need.package.split()])
        missing = [need for need in missing if need.find() is None]
    brought = Brought(playwright_environment())
    if any(need.name == "headless-shell" for need in missing) and (shell := _shell_of(needs)):
        brought.environment["URC_HEADLESS_SHELL"] = shell
        missing = [need for need in missing if need.name != "headless-shell"]
    brought.left_out = missing
    brought.environment["URC_LEFT_OUT"] = ",".join(need.name for need in brought.left_out)
    return brought


def _shell_of(needs: Sequence[Need]) -> str | None:
    """Return a browser that replaces the missing headless shell, or None."""
    whole = next(
        (path for need in needs if need.name == "chromium" and (path := need.find())), None
    )
    if whole is not None:
        return whole
    try:
        return bring_chromium()
    except BringError as error:
        print(f"npm could not provide a browser: {error}", flush=True)
        return None


def _apt_install(packages: list[str]) -> None:
    """Install Debian packages; after a failure, print the error."""
    print(f"installing {' '.join(packages)} ...", flush=True)
    _apt("update")
    if not _apt("install", "--no-install-recommends", *packages) and len(packages) > 1:
        for package in packages:  # one by one, so that an unknown package does not affect others
            _apt("install", "--no-install-recommends", package)


def _apt(*arguments: str) -> bool:
    command = ["apt-get", "-q", "-y", "-o", "Dpkg::Use-Pty=0", *arguments]
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True,
            timeout=APT_TIMEOUT_S, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        print(f"{' '.join(command)}: not finished within {APT_TIMEOUT_S} s", flush=True)
        return False
    if done.returncode != 0:
        print(f"{' '.join(command)}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}", flush=True)
    return done.returncode == 0


def _is_root() -> bool:
    return sys.platform != "win32" and os.geteuid() == 0
