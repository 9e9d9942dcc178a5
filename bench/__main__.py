"""`./dev bench [--full] [NAME…]`: every benchmark, or those named; 1 when a goal is missed."""

import argparse
import sys
from importlib import import_module

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
    "motion_path",
    "motion_stop",
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="./dev bench", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--full", action="store_true", help="more rounds")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in NAMES:
            parser.error(f"there is no benchmark {name!r}; there are: {', '.join(NAMES)}")
    missed = 0
    for name in arguments.names or NAMES:
        missed |= report(import_module(f"bench.{name}").run(full=arguments.full))
    return missed


if __name__ == "__main__":
    sys.exit(main())
