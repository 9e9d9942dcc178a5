"""`urc demo`: the gallery's robots, each emulated over real sockets, in the browser."""

import argparse
import os
import sys
import threading
import webbrowser
from collections.abc import Mapping
from contextlib import suppress

from urc.cli.arguments import add_dev, add_host, add_port, is_loopback
from urc.cli.failures import Misuse
from urc.problems import UrcError
from urc.shipped import shipped

EXAMPLE = "urc demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where to listen, and whether a browser is opened."""
    add_host(parser)
    add_port(parser)
    add_dev(parser)
    parser.add_argument("--no-browser", action="store_true", help="print the address only")


def run(arguments: argparse.Namespace) -> int:
    """Serve the demo until Ctrl-C or SIGTERM."""
    from urc.cli.dashboard import Place, run_dashboard
    from urc.config.load import load_profile
    from urc.runtime.catalog import built_in_catalog

    if arguments.dev and not is_loopback(arguments.host):
        raise Misuse(f"--dev shows all traffic and is for this machine alone, not {arguments.host}")
    catalog = built_in_catalog()
    files = sorted(shipped("robots").glob("*.yaml"))
    profiles = [load_profile(file, catalog) for file in files]
    if not profiles:
        raise UrcError(f"there are no robots in {shipped('robots')}")

    def announce(url: str) -> None:
        print(f"dashboard {url}   (Ctrl-C ends it)", flush=True)
        if not arguments.no_browser and has_screen(sys.platform, os.environ):
            threading.Thread(target=_open_browser, args=(url,), daemon=True).start()

    return run_dashboard(
        [(profile, {}) for profile in profiles],
        Place(arguments.host, arguments.port),
        is_simulated=True,
        on_ready=announce,
        settings_of=(lambda _: {}) if arguments.dev else None,
    )


def has_screen(platform: str, environment: Mapping[str, str]) -> bool:
    """Return whether a window can open: in a bare terminal a text browser would take it over."""
    if platform in ("win32", "darwin"):
        return True
    return any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _open_browser(url: str) -> None:
    """Open the page; in a thread of its own, because some browsers return when they are closed."""
    with suppress(webbrowser.Error, OSError):
        webbrowser.open(url)
