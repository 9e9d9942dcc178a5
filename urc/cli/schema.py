"""`urc schema`: the grammar of a kind of document, for editors and other programs."""

import argparse
import sys

from urc.cli.failures import Misuse
from urc.shipped import shipped

EXAMPLE = "urc schema robot > robot.schema.json"
KINDS = ("robot", "driver", "interface", "widget")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the kind."""
    parser.add_argument(
        "kind", metavar="KIND", nargs="?", choices=KINDS, help=f"one of {', '.join(KINDS)}"
    )
    parser.add_argument(
        "--path", action="store_true", help="print where its file is; without KIND, of all of them"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the schema, byte for byte as it ships."""
    folder = shipped("schemas")
    file = folder / f"{arguments.kind}.schema.json"
    if arguments.path:
        print(file if arguments.kind else folder)
    elif arguments.kind:
        sys.stdout.buffer.write(file.read_bytes())
    else:
        raise Misuse(f"KIND is missing: one of {', '.join(KINDS)}")
    return 0
