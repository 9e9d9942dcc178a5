"""`urc demo`: emulate all shipped robots over real sockets, and open the dashboard in a browser."""

import argparse
import os
import socket
import sys
import threading
import webbrowser
from collections.abc import Mapping
from contextlib import ExitStack, suppress

from urc.cli.arguments import add_dev, add_host, add_port, is_loopback
from urc.cli.error_report import Misuse
from urc.cli.fault_injection import add_faults
from urc.cli.progress import Progress
from urc.cli.start_addresses import ReadyDashboard
from urc.cli.tls_options import add_tls, tls_of
from urc.problems import UrcError
from urc.shipped import shipped

EXAMPLE = "urc demo"
USUAL_PORT = 8080
_ALL_NETWORKS = "0.0.0.0"  # noqa: S104 - --phone requires it; devices pair or sign in


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: address, faults and browser option."""
    add_host(parser)
    add_port(parser)
    parser.set_defaults(port=None)
    add_tls(parser)
    add_dev(parser)
    add_faults(parser, has_names=True)
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address without opening a browser"
    )
    parser.add_argument(
        "--phone",
        action="store_true",
        help="accept devices on this network, and print a QR code that pairs one of them until the"
        " demo ends",
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve the demo until Ctrl-C or SIGTERM."""
    from urc.cli.dashboard import DashboardAddress, run_dashboard
    from urc.cli.demo_phone import paired_until_end
    from urc.config.load import load_profile
    from urc.runtime.registries import built_in_catalog

    if arguments.phone and is_loopback(arguments.host):
        arguments.host = _ALL_NETWORKS
    if arguments.dev and not is_loopback(arguments.host):
        raise Misuse(
            "--dev shows all traffic, so it is allowed only on this machine;"
            f" found {'--phone' if arguments.phone else f'--host {arguments.host}'}"
        )
    catalog = built_in_catalog()
    files = sorted(shipped("robots").glob("*.yaml"))
    profiles = []
    with Progress("loading robots", len(files)) as progress:
        for file in files:
            progress.step(file.stem)
            profiles.append(load_profile(file, catalog))
    if not profiles:
        raise UrcError(f"{shipped('robots')} contains no robots")

    def announce(ready_dashboard: ReadyDashboard) -> None:
        first, *others = ready_dashboard.lines()
        print("\n".join((f"{first}   (Ctrl-C ends it)", *others)), flush=True)
        if arguments.phone:
            stack.enter_context(paired_until_end(ready_dashboard.others))
        elif sys.stdout.isatty() and is_loopback(arguments.host):
            print("on a phone: 'urc demo --phone' prints a QR code", flush=True)
        if not arguments.no_browser and has_screen(sys.platform, os.environ):
            # Every user of this machine can read the command line of a browser.
            url = ready_dashboard.address_once
            threading.Thread(target=_open_browser, args=(url,), daemon=True).start()

    with ExitStack() as stack:
        return run_dashboard(
            profiles,
            DashboardAddress(arguments.host, _port(arguments), tls=tls_of(arguments)),
            is_simulated=True,
            on_ready=announce,
            is_dev=arguments.dev,
            faults=arguments.faults,
        )


def _port(arguments: argparse.Namespace) -> int:
    """Return the given port, else the default port if it is free, else 0 for any free port."""
    if arguments.port is not None:
        return int(arguments.port)
    family = socket.AF_INET6 if ":" in arguments.host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe, suppress(OSError):
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((arguments.host, USUAL_PORT))
        return USUAL_PORT
    return 0


def has_screen(platform: str, environment: Mapping[str, str]) -> bool:
    """Return whether a graphical browser can open; a text browser would block the terminal."""
    if platform in ("win32", "darwin"):
        return True
    return any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _open_browser(url: str) -> None:
    """Open the page in a thread, because some browsers block until their window is closed."""
    with suppress(webbrowser.Error, OSError):
        webbrowser.open(url)
