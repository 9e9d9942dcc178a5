"""`./dev bench [--full] [NAME…]`: run all or some benchmarks.

The exit code is 1 if a goal is missed.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module

from bench.figures import PAGES, told, write_docs
from bench.harness import report
from hatch_build import VendorError
from scripts.check import install_checkers
from scripts.needs import NEEDS, bring

NAMES = (
    "startup",
    "engine_binary",
    "ros_messages",
    "driver_poll",
    "driver_flood",
    "fanout",
    "fanout_stall",
    "server_robots",
    "browser_peers",
    "browser_widgets",
    "browser_roslibjs",
    "browser_turtlebot",
    "ros_lines",
    "page_layouts",
    "operator_tasks",
    "playground",
    "browser_frames",
    "browser_firefox",
    "browser_webkit",
    "tests_thorough",
    "motion_path",
    "motion_cost",
    "motion_stop",
    "motion_revoked",
    "motion_engine",
    "motion_guard",
    "motion_cuts",
    "motion_freeze",
    "motion_foxglove",
    "motion_zenoh",
    "fleet_cuts",
    "fleet_overload",
    "fleet_ticks",
    "fleet_size",
    "fleet_soak",
    "fleet_stop",
    "motion_counters",
    "motion_flood",
    "motion_idle",
    "motion_input",
    "motion_loss",
    "driving_lock",
    "video_age",
    "video_line",
    "video_relay",
)

PROGRAMS = {
    "video_age": ("chromium", "rtsp-server"),
    "browser_peers": ("chromium",),
    "browser_widgets": ("chromium",),
    "browser_roslibjs": ("chromium", "roslib"),
    "browser_turtlebot": ("chromium", "roslib"),
    "ros_lines": ("chromium",),
    "browser_frames": ("webkit-driver", "xvfb"),
    "browser_firefox": ("firefox", "node", "puppeteer"),
    "browser_webkit": ("webkit-driver", "xvfb"),
    "page_layouts": ("chromium",),
    "operator_tasks": ("chromium",),
    "playground": ("chromium", "node", "pyodide", "axe"),
    "motion_input": ("chromium",),
    "driving_lock": ("chromium", "ffmpeg"),
    "video_line": ("ffmpeg",),
    "video_relay": ("ffmpeg", "chromium"),
}
"""Programs that each benchmark needs besides Python, as named in `scripts.needs`."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="./dev bench", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--full", action="store_true", help="run more rounds")
    parser.add_argument(
        "--write-docs",
        action="store_true",
        help=f"write the results to {' and '.join(page.name for page in PAGES)}",
    )
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in NAMES:
            parser.error(f"unknown benchmark {name!r}; the benchmarks are: {', '.join(NAMES)}")
    names = arguments.names or NAMES
    left_out = bring_programs(names)
    missed = int(bool(left_out))
    for name in names:
        if name in left_out:
            continue
        missed |= report(import_module(f"bench.{name}").run(full=arguments.full))
        if arguments.write_docs and told:
            write_docs()
    return missed


def bring_programs(names: Sequence[str]) -> set[str]:
    """Install programs for these benchmarks; return the benchmarks that still lack a program."""
    wanted = {program for name in names for program in PROGRAMS.get(name, ())}
    brought = bring([need for need in NEEDS if need.name in wanted])
    if any(need.is_of_npm for need in brought.left_out):
        with suppress(VendorError):  # the remedy below names npm
            install_checkers()
        brought.look_again()
    os.environ.update(brought.environment)
    missing = {need.name for need in brought.left_out}
    left_out = {name for name in names if missing.intersection(PROGRAMS.get(name, ()))}
    for name in sorted(left_out):
        remedy = f"to install: {brought.remedy}"
        lacks = ", ".join(sorted(missing.intersection(PROGRAMS[name])))
        print(f"bench: {name} skipped: missing {lacks}; {remedy}", file=sys.stderr)
    return left_out


if __name__ == "__main__":
    sys.exit(main())
