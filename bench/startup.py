"""What a command costs before it does anything: whole processes, against tools people know."""

import platform
import shutil
import sys
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path

from bench.harness import Goal, Result, compare, process_seconds

ROOT = Path(__file__).resolve().parents[1]
PROFILE = ROOT / "robots" / "puppet.yaml"
SCHEMA = ROOT / "schemas" / "robot.schema.json"


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure `urc --version` and `urc validate`."""
    rounds = 41 if full else 15
    versions = {
        "python": platform.python_version(),
        "check-jsonschema": version("check-jsonschema"),
        "PyYAML": version("PyYAML"),
        "Jinja2": version("Jinja2"),
    }
    bare = partial(process_seconds, [sys.executable, "-c", "pass"])
    urc = _beside("urc")
    checker = _beside("check-jsonschema")
    return [
        compare(
            Goal("startup: urc --version / bare interpreter", 2.5),
            bare,
            partial(process_seconds, [urc, "--version"]),
            rounds=rounds,
            versions=versions,
        ),
        compare(
            Goal("startup: urc validate puppet / check-jsonschema", 0.5),
            partial(process_seconds, [checker, "--schemafile", str(SCHEMA), str(PROFILE)]),
            partial(process_seconds, [urc, "validate", str(PROFILE)]),
            rounds=rounds,
            versions=versions,
        ),
        compare(
            Goal("startup: import of urc validate / bare interpreter", 8.0),
            bare,
            partial(process_seconds, [sys.executable, "-c", _IMPORTS]),
            rounds=rounds,
            versions=versions,
        ),
    ]


# What `urc validate` imports for a good document, and nothing else of its work.
_IMPORTS = "import urc.cli.arguments, urc.cli.validate, urc.config.load, urc.runtime.selftest"


def _beside(name: str) -> str:
    """Return the program that belongs to this interpreter's environment."""
    place = Path(sys.executable).with_name(name)
    found = str(place) if place.exists() else shutil.which(name)
    if found is None:
        raise SystemExit(f"bench: {name} is not installed; './dev bench' sets everything up")
    return found
