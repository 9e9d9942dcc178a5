"""The locks of `./dev`: exact versions with hashes, of all that pyproject.toml asks for.

When this fails after a change of the dependencies: `pip install uv`, `python -m scripts.lock`.
"""

import re
import tomllib
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from scripts.lock import LOCKS

ROOT = Path(__file__).resolve().parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
GROUPS = PROJECT["dependency-groups"]
WANTED = {
    "demo": [
        *PROJECT["project"]["dependencies"],
        *PROJECT["project"]["optional-dependencies"]["demo"],
    ],
    "build": GROUPS["build"],
    "dev": [*PROJECT["project"]["dependencies"], *GROUPS["build"], *GROUPS["dev"]],
    "node": GROUPS["node"],
}
SYSTEMS = [
    {"sys_platform": system, "platform_machine": machine, "os_name": os}
    for system, os, machines in (
        ("linux", "posix", ("x86_64", "aarch64")),
        ("darwin", "posix", ("x86_64", "arm64")),
        ("win32", "nt", ("AMD64",)),
    )
    for machine in machines
]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


class Locked(NamedTuple):
    """One entry of a lock."""

    requirement: Requirement
    hashes: tuple[str, ...]

    @property
    def version(self) -> Version:
        """Its exact version."""
        (one,) = self.requirement.specifier
        assert one.operator == "=="
        return Version(one.version)


def text_of(lock: str) -> str:
    return (ROOT / "requirements" / f"{lock}.txt").read_text("utf-8")


def entries(lock: str) -> dict[str, list[Locked]]:
    """Return the entries of a lock by package; some have another version for another Python."""
    found: dict[str, list[Locked]] = defaultdict(list)
    lines = [line for line in text_of(lock).splitlines() if not line.startswith("#")]
    for block in re.split(r"\n(?=\S)", "\n".join(lines)):
        head, *rest = [part.strip() for part in block.split("\\\n")]
        requirement = Requirement(head)
        found[canonicalize_name(requirement.name)].append(Locked(requirement, tuple(rest)))
    return found


def environments() -> list[dict[str, str]]:
    named = {"implementation_name": "cpython", "platform_python_implementation": "CPython"}
    return [
        {**named, **system, "python_version": python, "python_full_version": f"{python}.1"}
        for system in SYSTEMS
        for python in PYTHONS
    ]


def fits(requirement: Requirement, environment: dict[str, str]) -> bool:
    return requirement.marker is None or requirement.marker.evaluate({**environment, "extra": ""})


@pytest.mark.parametrize("lock", LOCKS)
def test_each_entry_has_an_exact_version_and_hashes(lock: str) -> None:
    for some in entries(lock).values():
        for one in some:
            assert one.version
            assert one.hashes, one.requirement
            for line in one.hashes:
                assert re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", line), line


@pytest.mark.parametrize("lock", LOCKS)
def test_no_lock_names_a_host(lock: str) -> None:
    """The machine's own configuration of pip selects the registry."""
    assert not re.search(r"://|@ |--index|--extra|--find|--trusted", text_of(lock))


@pytest.mark.parametrize("lock", LOCKS)
@pytest.mark.parametrize("environment", environments(), ids=lambda one: " ".join(one.values()))
def test_each_system_finds_what_the_project_asks_for(
    lock: str, environment: dict[str, str]
) -> None:
    """One version, which the project accepts, on each system and Python that `./dev` locks."""
    locked = entries(lock)
    for wanted in map(Requirement, WANTED[lock]):
        if fits(wanted, environment):
            some = locked.get(canonicalize_name(wanted.name), [])
            found = [one for one in some if fits(one.requirement, environment)]
            assert len(found) == 1, f"{wanted}: run python -m scripts.lock"
            assert wanted.specifier.contains(found[0].version, prereleases=True), wanted


def test_the_locks_agree() -> None:
    """Tests run with the versions of the demo."""
    dev = entries("dev")
    for lock in ("demo", "build"):
        for name, some in entries(lock).items():
            assert {one.version for one in some} <= {one.version for one in dev[name]}, name


def test_dev_names_the_locked_pythons() -> None:
    script = (ROOT / "dev").read_text("utf-8")
    newest = tuple(map(int, PYTHONS[-1].split(".")))
    assert f"NEWEST_LOCKED = {newest}" in script
    assert f"OLDEST = {tuple(map(int, PYTHONS[0].split('.')))}" in script
