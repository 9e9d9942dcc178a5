"""`urc doctor`: check this machine's features."""

import argparse
import platform
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from urc import __version__
from urc._extras import install_command
from urc._folders import data_folder
from urc.cli.arguments import add_port
from urc.cli.colours import Style, painted
from urc.cli.output import complain
from urc.problems import UrcError, printable
from urc.shipped import shipped, vendored

EXAMPLE = "urc doctor"

REQUIRED = {
    "PyYAML": "reads documents",
    "jsonschema": "explains problems in documents",
    "Jinja2": "templates and pages",
    "jmespath": "queries for values in JSON",
    "starlette": "the dashboard's pages",
    "uvicorn": "the dashboard's server",
    "websockets": "live values on the dashboard",
    "msgspec": "the dashboard's messages",
    "asyncssh": "robots behind SSH",
    "roslibpy": "robots behind rosbridge",
}
EXTRAS = {
    "numpy": ("demo", "cameras and laser scanners of emulated robots"),
    "pillow": ("images", "raw images of ROS, and cameras of emulated robots"),
    "serialx": ("serial", "robots on serial ports"),
    "paho-mqtt": ("mqtt", "robots behind an MQTT broker"),
    "eclipse-zenoh": ("zenoh", "devices with Zenoh keys, ROS 2 over Zenoh, and fleets"),
    "xxhash": ("zenoh", "ROS 2 over Zenoh"),
    "cbor2": ("cbor", "CBOR images from rosbridge"),
    "zeroconf": ("mdns", "discovery of announced robots by 'urc discover'"),
    "prometheus-client": ("metrics", "metrics for Prometheus and other monitoring systems"),
    "mcap": ("record", "recordings of sessions"),
    "av": ("video", "cameras that send H.264 or H.265"),
    "aiortc": ("whep", "cameras behind a WebRTC server, with WHEP"),
    "joserfc": ("oidc", "sign-in with an OpenID Connect provider, and fleets"),
}
"""Extra and purpose of each optional package, by package name."""
OPTIONAL = {
    "google-re2": "patterns without provably linear run time; without this package, URC refuses"
    " them",
    "uvloop": "a faster event loop; without this package, held commands have slightly more delay",
}
FOLDERS: tuple[Literal["schemas", "robots", "widgets", "templates"], ...] = (
    "schemas",
    "robots",
    "widgets",
    "templates",
)
_MEGABYTE = 1_000_000
LEAST_FREE = 20 * _MEGABYTE
"""Free space in bytes below which the disk of the data folder counts as full."""
_VENDOR_REMEDY = "install the wheel, or run ./dev once; plots are not available without these files"


@dataclass(frozen=True, slots=True)
class _Finding:
    name: str
    is_good: bool
    text: str
    is_required: bool = True


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: port and data folder to check."""
    add_port(parser)
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print one line for each check; return 1 if a requirement is missing."""
    problems = list(_problems(arguments.port, arguments.data or data_folder()))
    width = max(len(finding.name) for finding in problems)
    for finding in problems:
        mark = "ok     " if finding.is_good else "MISSING" if finding.is_required else "note   "
        style: Style = "good" if finding.is_good else "bad" if finding.is_required else "warning"
        print(painted(mark, style), printable(f"{finding.name:<{width}}  {finding.text}"))
    missing = sum(finding.is_required and not finding.is_good for finding in problems)
    if missing:
        complain(f"urc doctor: {missing} of {len(problems)} checks failed")
    return int(missing > 0)


def _problems(port: int, data: Path) -> Iterator[_Finding]:
    yield _Finding("urc", True, f"{__version__} on Python {platform.python_version()}")
    for name, purpose in REQUIRED.items():
        yield _package(name, purpose, is_required=True)
    for name, purpose in OPTIONAL.items():
        yield _package(name, purpose, is_required=False)
    for name, (extra, purpose) in EXTRAS.items():
        found = _package(name, purpose, is_required=False)
        if not found.is_good:
            found = replace(found, text=f"{found.text}: {install_command(extra)}")
        yield found
    for folder in FOLDERS:
        place = shipped(folder)
        is_there = place.is_dir() and any(place.iterdir())
        yield _Finding(f"{folder}/", is_there, "ships with URC" if is_there else f"not at {place}")
    yield _attempt("robots", _load_robots)
    is_vendored = vendored() is not None
    text = "third-party modules for the browser" if is_vendored else _VENDOR_REMEDY
    yield _Finding("urc_vendor", is_vendored, text, is_required=False)
    yield _priority()
    yield _clock(data)
    yield _disk(data)
    yield _attempt("authority", lambda: _authority(data), is_required=False)
    yield from _fleet(data)
    yield _attempt("port", lambda: _try_port(port), is_required=False)


def _package(name: str, purpose: str, *, is_required: bool) -> _Finding:
    try:
        return _Finding(name, True, f"{version(name)}: {purpose}", is_required)
    except PackageNotFoundError:
        return _Finding(name, False, f"not installed: {purpose}", is_required)


def _attempt(name: str, check: Callable[[], str], *, is_required: bool = True) -> _Finding:
    try:
        return _Finding(name, True, check(), is_required)
    except (UrcError, ImportError) as fault:  # a missing package cannot be imported
        return _Finding(name, False, str(fault), is_required)


def _priority() -> _Finding:
    from urc.guard.real_time_priority import why_not

    refusal = why_not()
    text = "the guard has a higher priority than ordinary programs"
    if refusal:
        text = f"the guard has ordinary priority ({refusal}); see docs/motion.md"
    return _Finding("real time", not refusal, text, is_required=False)


def _clock(data: Path) -> _Finding:
    from urc.web.serve.clock_check import clock_warning

    warning = clock_warning(data)
    text = warning or "no sign that the clock is behind"
    return _Finding("clock", not warning, text, is_required=False)


def _authority(data: Path) -> str:
    """Return the fingerprint and expiry date of the local certificate authority, if it exists."""
    from cryptography import x509

    from urc.access.authority import AUTHORITY_FOLDER, fingerprint

    file = data / AUTHORITY_FOLDER / "authority.pem"
    try:
        root = x509.load_pem_x509_certificate(file.read_bytes())
    except FileNotFoundError:
        return "not needed yet: created for the first server that other machines can reach"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "expected a certificate in PEM"
        raise UrcError(f"{file} cannot be used: {reason}") from error
    return f"{fingerprint(root)}, until {root.not_valid_after_utc:%Y-%m-%d}"


def _disk(data: Path) -> _Finding:
    place = next((one for one in (data, *data.parents) if one.exists()), data)
    try:
        free = shutil.disk_usage(place).free
    except OSError as error:
        return _Finding("disk", False, f"{place}: {error.strerror}", is_required=False)
    text = f"{free // _MEGABYTE} MB are free for {data}"
    if free < LEAST_FREE:
        text += "; delete files: the server cannot keep its log, latches and revocations"
    return _Finding("disk", free >= LEAST_FREE, text)


def _fleet(data: Path) -> Iterator[_Finding]:
    from urc.cli.fleet_sites import site_faults
    from urc.fleet.faults import membership_faults
    from urc.fleet.files import FLEET_FOLDER
    from urc.fleet.membership import Membership, NoMembership
    from urc.fleet.reach import reach_faults
    from urc.fleet.rules import OPEN
    from urc.fleet.rules_file import RULES_FILE, read_rules

    faults = [*membership_faults(data / FLEET_FOLDER, datetime.now(UTC))]
    yield from (_Finding("fleet", False, fault) for fault in faults)
    if not faults:
        try:
            own = Membership.load(data / FLEET_FOLDER)
        except NoMembership:
            yield _Finding("fleet", True, "this server is in no fleet")
            return
        ends = f"{own.certificate.ends:%Y-%m-%d %H:%M} UTC"
        yield _Finding("fleet", True, f"site {own.site} of fleet {own.fleet}, until {ends}")
        rules = read_rules(data / FLEET_FOLDER / RULES_FILE)
        text = f"{len(rules.rules)} rules for visitors; see 'urc fleet rules'"
        if rules is OPEN:
            text = "visitors may drive if their site proposes it; see 'urc fleet rules'"
        yield _Finding("fleet rules", True, text)
        faults = [*reach_faults(own, datetime.now(UTC)), *site_faults(data)]
        yield from (_Finding("fleet", False, one) for one in faults)


def _load_robots() -> str:
    from urc.config.load import load_profile
    from urc.runtime.registries import built_in_catalog

    files = sorted(shipped("robots").glob("*.yaml"))
    for file in files:
        load_profile(file, built_in_catalog())
    return f"{len(files)} of {len(files)} shipped robots are valid"


def _try_port(port: int) -> str:
    import socket

    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise UrcError(
                f"127.0.0.1:{port}: {reason}; choose another port with --port"
            ) from error
        return f"127.0.0.1:{probe.getsockname()[1]} is free for the dashboard"
