"""The floors of the house: a module imports only from floors below its own, siblings never.

An import in a function counts as one at the top, and one for type checkers too: laziness is for
start-up time, not for going round the house.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.modules import MODULES, ROOT, imports_of, tree_of

FLOORS = {
    "__init__": 7,  # the names for Python users: each is imported on first use, from any floor
    "cli": 6,
    "web": 5,
    "runtime": 4, "simulator": 4, "access": 4, "fleet": 4,
    "client": 5,
    "wire": 3.5,  # what the server and its clients say to each other: they share nothing else
    "guard": 3.5,  # a landing: it stands on transports and motion, and sessions stand on it
    "config": 3, "protocol": 3, "transports": 3, "packages": 3, "motion": 3,
    "alarms": 3,
    "model": 2,
    "source": 1, "registry": 1, "shipped": 1, "private_files": 1, "expressions": 1, "patterns": 1,
    "key_expressions": 1,
    "ros_names": 1,
    "images": 1, "video": 1, "capture_clock": 1, "video_reader": 1.5,
    "filters": 0,  # of expressions, which stand on them
    "problems": -1,  # the ground: every error of ours is an UrcError, so all may stand on it
}  # fmt: skip

# Pure floors do no I/O and have no clock: that is why they can be tested to the last byte.
PURE = {"model", "protocol", "motion", "alarms", "wire"}
IMPURE = {"asyncio", "socket", "ssl", "threading", "starlette", "uvicorn", "websockets"}


def floor_of(part: str) -> float:
    """Return a part's floor: private modules at the top are the cellar, unknown parts a tower."""
    return FLOORS.get(part, 0 if part.startswith("_") else 99)


def faults_of(path: str, tree: ast.Module) -> Iterator[str]:
    """Yield one line for each import that the module may not have."""
    part = Path(path).parts[1].removesuffix(".py")
    for line, name in imports_of(path, tree):
        top, _, rest = name.partition(".")
        other = rest.partition(".")[0]
        if part in PURE and top in IMPURE:
            yield f"{path}:{line}: {part} is pure and may not import {top}"
        in_cellar = floor_of(part) == floor_of(other) == 0
        inside = other in (part, "__version__") or in_cellar
        # urc/testing is for tests alone: it may import anything, and nothing imports it.
        if top == "urc" and not inside and part != "testing" and floor_of(other) >= floor_of(part):
            yield f"{path}:{line}: {part} may not import {other or 'urc'}"


def test_imports_only_from_floors_below() -> None:
    """No module reaches up, or across to a sibling."""
    names = {path: str(path.relative_to(ROOT)) for path in MODULES}
    faults = (fault for path in MODULES for fault in faults_of(names[path], tree_of(path)))
    assert list(faults) == []


@pytest.mark.parametrize(
    ("path", "text", "fault"),
    [
        (
            "urc/protocol/a.py",
            "def f():\n import urc.runtime.hub",
            "2: protocol may not import runtime",
        ),
        ("urc/protocol/a.py", "from urc import config", "1: protocol may not import config"),
        ("urc/model/a.py", "from ..config import load", "1: model may not import config"),
        (
            "urc/model/a.py",
            "from asyncio import Queue",
            "1: model is pure and may not import asyncio",
        ),
        ("urc/web/a.py", "from urc import connect", "1: web may not import connect"),
        ("urc/source.py", "import urc.registry", "1: source may not import registry"),
        ("urc/cli/a.py", "import urc.testing.clock", "1: cli may not import testing"),
    ],
)
def test_a_forbidden_import_is_found(path: str, text: str, fault: str) -> None:
    """The check sees imports in functions, relative ones and whole packages."""
    assert list(faults_of(path, ast.parse(text))) == [f"{path}:{fault}"]


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("urc/cli/a.py", "from urc import __version__"),
        ("urc/protocol/a.py", "from .framing import FRAMINGS\nfrom urc.model.values import Value"),
        ("urc/patterns.py", "from urc._translator import translate"),
        ("urc/runtime/a.py", "import asyncio"),
    ],
)
def test_imports_downwards_and_inside_are_allowed(path: str, text: str) -> None:
    """What the house allows is not reported."""
    assert list(faults_of(path, ast.parse(text))) == []
