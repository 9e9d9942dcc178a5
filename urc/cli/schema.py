"""`urc schema`: print the JSON Schema for a kind of document, for editors and other programs."""

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

from urc.cli.error_report import Misuse
from urc.shipped import shipped

EXAMPLE = "urc schema robot > robot.schema.json"
KINDS = ("robot", "driver", "interface", "widget", "site-rules")

_OTHER = re.compile(r'"\$ref": *"([a-z-]+\.schema\.json)')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: kind of document."""
    parser.add_argument(
        "kind", metavar="KIND", nargs="?", choices=KINDS, help=f"one of {', '.join(KINDS)}"
    )
    parser.add_argument(
        "--path",
        action="store_true",
        help="print the path of the schema file; without KIND, the path of the folder with all"
        " schemas",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the schema with its references resolved, or the path of its file."""
    folder = shipped("schemas")
    file = folder / f"{arguments.kind}.schema.json"
    if arguments.path:
        print(file if arguments.kind else folder)
    elif arguments.kind:
        sys.stdout.write(json.dumps(_bundled(folder, file.name), indent=2, ensure_ascii=False))
        sys.stdout.write("\n")
    else:
        raise Misuse(f"KIND is missing: expected one of {', '.join(KINDS)}")
    return 0


def _bundled(folder: Path, name: str) -> Any:
    """Return the schema `name` with all referenced schemas under its ``$defs``."""
    pending, texts = [name], {name: (folder / name).read_text("utf-8")}
    while pending:
        for other in _OTHER.findall(texts[pending.pop()]):
            if other not in texts:
                texts[other] = (folder / other).read_text("utf-8")
                pending.append(other)
    schemas = {each: json.loads(text) for each, text in texts.items()}
    bundle = _relinked(schemas.pop(name), name, name)
    inner = {each: _relinked(schema, each, name) for each, schema in schemas.items()}
    return bundle | {"$defs": bundle.get("$defs", {}) | inner}


def _relinked(node: Any, here: str, root: str) -> Any:
    """Return a schema with references that are valid inside the bundle of the schema `root`."""
    if isinstance(node, list):
        return [_relinked(item, here, root) for item in node]
    if not isinstance(node, dict):
        return node
    linked = {key: _relinked(value, here, root) for key, value in node.items()}
    if isinstance(node.get("$ref"), str):
        file, _, pointer = node["$ref"].partition("#")
        file = file or here
        place = "" if file == root else f"/$defs/{file}"
        linked["$ref"] = f"#{place}{pointer}"
    return linked
