"""Run time of complete commands, compared with common tools."""

import platform
import shutil
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path

from bench.harness import Goal, Result, compare, process_seconds
from bench.profiles import write_profiles

ROOT = Path(__file__).resolve().parents[1]
PROFILE = ROOT / "robots" / "puppet.yaml"
PROFILES = 100
SCHEMA = ROOT / "schemas" / "robot.schema.json"


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the run times of `urc --version` and `urc validate`."""
    with tempfile.TemporaryDirectory() as folder:
        return _run(write_profiles(Path(folder), PROFILES), full=full)


def _run(profiles: list[str], *, full: bool) -> Sequence[Result]:
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
            Goal(f"startup: urc validate {PROFILES} profiles / check-jsonschema", 0.5),
            partial(process_seconds, [checker, "--schemafile", str(SCHEMA), *profiles]),
            partial(process_seconds, [urc, "validate", *profiles]),
            rounds=9 if full else 5,
            versions=versions,
        ),
    ]


def _beside(name: str) -> str:
    """Return the path of a program in this interpreter's environment."""
    place = Path(sys.executable).with_name(name)
    found = str(place) if place.exists() else shutil.which(name)
    if found is None:
        raise SystemExit(
            f"bench: {name} is not installed; './dev bench' installs all required programs"
        )
    return found
