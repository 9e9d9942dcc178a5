"""`./dev bench [--full] [NAME…]`: every benchmark, or those named; 1 when a goal is missed."""

import argparse
import sys
from importlib import import_module

from bench.figures import PAGE, told, write_docs
from bench.harness import report

NAMES = (
    "startup",
    "engine_binary",
    "engine_text",
    "driver_poll",
    "driver_flood",
    "transport_tcp",
    "transport_udp",
    "transport_serial",
    "transport_ssh",
    "transport_telnet",
    "transport_http",
    "transport_websocket",
    "transport_rosbridge",
    "transport_mqtt",
    "fanout",
    "fanout_stall",
    "image_relay",
    "packages_index",
    "gallery",
    "browser_peers",
    "browser_widgets",
    "browser_plot_scan",
    "browser_needle",
    "wire_to_pixel",
    "motion_path",
    "motion_stop",
    "motion_engine",
    "motion_guard",
    "motion_cuts",
    "motion_flood",
    "motion_idle",
    "motion_input",
    "motion_loss",
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="./dev bench", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--full", action="store_true", help="more rounds")
    parser.add_argument(
        "--write-docs", action="store_true", help=f"put the figures of motion into {PAGE.name}"
    )
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in NAMES:
            parser.error(f"there is no benchmark {name!r}; there are: {', '.join(NAMES)}")
    missed = 0
    for name in arguments.names or NAMES:
        missed |= report(import_module(f"bench.{name}").run(full=arguments.full))
        if arguments.write_docs and told:
            write_docs()
    return missed


if __name__ == "__main__":
    sys.exit(main())
