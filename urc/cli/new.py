"""`urc new`: create the files for a new, valid widget as a starting point."""

import argparse
import os
import re
from pathlib import Path

from urc.shipped import shipped

EXAMPLE = "urc new widget lamp"

_NAME = re.compile(r"[a-z][a-z0-9-]{0,63}")
_FILES = Path(__file__).resolve().parent / "new_widget"
_SCHEMA = shipped("schemas") / "widget.schema.json"
_TYPES = Path(__file__).resolve().parents[1] / "web" / "static" / "core/types.js"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: kind and name of the package."""
    parser.add_argument(
        "kind", metavar="KIND", choices=("widget",), help="kind of package to create: widget"
    )
    parser.add_argument(
        "name", metavar="NAME", help="name of the widget: lower-case letters, digits and '-'"
    )
    parser.add_argument(
        "--into",
        metavar="DIR",
        type=Path,
        help="parent folder of the new folder"
        " (default: 'widgets' in the current folder, next to the robots that use the widget)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Create the folder of the widget; raise `UrcError` if the folder exists."""
    from urc.problems import UrcError

    name: str = arguments.name
    if not _NAME.fullmatch(name):
        raise UrcError(
            f"{name!r} is not a valid widget name: use lower-case letters, digits and '-'"
        )
    if (shipped("widgets") / name).is_dir():
        raise UrcError(f"a widget with the name {name!r} ships with URC and takes precedence")
    home: Path = arguments.into or Path("widgets")
    folder = home / name
    try:
        home.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
        for source in sorted(_FILES.iterdir()):
            text = source.read_text(encoding="utf-8")
            (folder / source.name).write_text(_filled(text, name, folder), encoding="utf-8")
    except FileExistsError as error:
        raise UrcError(f"{folder} already exists") from error
    except OSError as error:
        raise UrcError(f"{folder} cannot be created: {error.strerror or error}") from error
    print(folder)
    return 0


def _filled(text: str, name: str, folder: Path) -> str:
    words = name.replace("-", " ")
    text = text.replace("NEW-WIDGET", name).replace("NEW TITLE", words[:1].upper() + words[1:])
    for place, target in (("SCHEMA", _SCHEMA), ("TYPES", _TYPES)):
        text = text.replace(f"PATH-OF-{place}", _path_to(target, folder))
    return text


def _path_to(target: Path, folder: Path) -> str:
    """Return the path from a folder to a URC file.

    The path is relative if both are in the same checkout, and otherwise absolute.
    """
    home = shipped("schemas").parent.resolve()
    if folder.resolve().is_relative_to(home):
        return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()
    return target.resolve().as_posix()
