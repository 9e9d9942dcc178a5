"""Kills processes that change a store, and looks at what is left. Run as a program of its own.

A process that forks must have no threads, which a test runner has:
``python -m tests.e2e.package_killer FOLDER add|update|back|remove|publish``, or
``… FOLDER random ROUNDS SEED``.
Nothing is forced to the disk here: what a process wrote outlives it.
"""

import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from tests.unit.packages.made import accepted, assert_whole, install, package
from urc.packages import atomic_files
from urc.packages.index import INDEX, read_index
from urc.packages.index_builder import make_index
from urc.packages.index_head import HEAD, read_head
from urc.packages.names import PackageError, parse_requirement
from urc.packages.package import Package, sha256
from urc.packages.signature import Signature, new_signer
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.packages.submission import take
from urc.packages.update import plan_update

DIAL = package("widget", "dial", "1.0.0")
DIAL_2 = package("widget", "dial", "2.0.0", big="x" * 200_000)
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "^1"})
BOT_2 = package("driver", "bot", "2.0.0", {"widgets/dial": "^2"})
CAR = package("driver", "car", "1.0.0", {"widgets/dial": "*"})
SIGNED: dict[str, Signature] = {}
BOTS = {"drivers/bot 1.0.0", "drivers/bot 2.0.0"}


def add(store: Store) -> None:
    install(store, BOT, DIAL, DIAL_2)


def update(store: Store) -> None:
    """Do as `urc update` does, where the older version is there."""
    old = store.find(parse_requirement("bot@1.0.0"))
    if old is None:
        return
    source = FileSource("lab", [BOT_2, DIAL, DIAL_2], [BOT.manifest.key])
    plan = plan_update(old, [source], store, fail)
    assert plan is not None
    with store.changing() as change:
        change.stage(accepted(plan))
        change.replace(old, plan)


def back(store: Store) -> None:
    """Undo the last update, where there was one."""
    for lock in store.installed():
        if store.previous(lock) is not None:
            with store.changing() as change:
                change.back(lock)


def remove(store: Store) -> None:
    with store.changing() as change:
        try:
            change.remove(parse_requirement("bot"))
        except PackageError as error:
            if "is not installed" not in str(error):
                raise


def fail(line: str) -> None:
    raise AssertionError(line)


ACTS: dict[str, Callable[[Store], None]] = {
    "add": add,
    "update": update,
    "back": back,
    "remove": remove,
}


class DeadlyOs:
    """`os`, which kills this process just before its n-th change of the disk; -1: never."""

    def __init__(self, changes: int) -> None:
        self.left = changes

    def __getattr__(self, name: str) -> Any:
        found = (lambda number: None) if name == "fsync" else getattr(os, name)
        changing = ("write", "fsync", "replace", "open", "unlink")
        return self.deadly(found) if name in changing else found

    def deadly(self, found: Callable[..., Any]) -> Callable[..., Any]:
        def change(*words: Any, **more: Any) -> Any:
            if self.left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            self.left -= 1
            return found(*words, **more)

        return change


def forked(work: Callable[[], None]) -> int:
    """Start a process that does some work and ends; return its id."""
    child = os.fork()
    if not child:
        _work(work)
    return child


def _work(work: Callable[[], None]) -> NoReturn:
    code = 1
    try:
        work()
        code = 0
    finally:
        os._exit(code)


def die_at(store: Store, act: str, changes: int) -> None:
    deadly = DeadlyOs(changes)
    atomic_files.os = deadly  # type: ignore[attr-defined,assignment]
    atomic_files.mkdtemp = deadly.deadly(atomic_files.mkdtemp)
    ACTS[act](store)


def steps(folder: Path, act: str) -> None:
    """Die at every single change of the disk that an act makes."""
    for changes in range(500):
        store = Store(folder / f"{act}-{changes}")
        install(store, CAR, DIAL)
        if act != "add":
            add(store)
        if act == "back":
            update(store)
        child = forked(lambda store=store, at=changes: die_at(store, act, at))
        status = os.waitpid(child, 0)[1]
        left = set(assert_whole(store))
        assert "drivers/car 1.0.0" in left, left
        assert left <= BOTS | {"drivers/car 1.0.0"}, left
        assert act in ("add", "remove") or len(left) == 2, left  # one version or the other
        ACTS[act](store)  # what was interrupted can be done again
        assert "drivers/car 1.0.0" in assert_whole(store)
        if not os.WIFSIGNALED(status):
            assert os.waitstatus_to_exitcode(status) == 0
            assert changes > 5
            sys.stdout.write(f"{act}: whole after each of {changes} deaths\n")
            return
    raise AssertionError(f"{act} never ended by itself")


def at_random(folder: Path, rounds: int, seed: int) -> None:
    """Die at any moment, in the midst of one change after the other."""
    chance = random.Random(seed)  # noqa: S311 (moments, not secrets)
    store = Store(folder / "random")
    install(store, CAR, DIAL)
    seen: set[frozenset[str]] = set()
    for _ in range(rounds):
        order = [chance.choice(list(ACTS)) for _ in range(100)]
        child = forked(lambda order=order: [ACTS[act](store) for act in order] and None)
        time.sleep(chance.uniform(0.0, 0.04))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        left = set(assert_whole(store))
        assert "drivers/car 1.0.0" in left, left
        assert left <= BOTS | {"drivers/car 1.0.0"}, left
        seen.add(frozenset(left))
    sys.stdout.write(f"random: whole after {rounds} deaths, in {len(seen)} states\n")


def publish(folder: Path) -> None:
    """Die at every single change of the disk that publishing a package makes."""
    for changes in range(500):
        lab = folder / f"publish-{changes}"
        lab.mkdir()
        make_index(lab, "Lab", sound)
        assert whole(lab, put(lab, DIAL)) == ["widgets/dial 1.0.0"]
        child = forked(lambda lab=lab, at=changes: put_and_die(lab, at))
        status = os.waitpid(child, 0)[1]
        assert whole(lab, True) in (["widgets/dial 1.0.0"], [*BOTH])
        put(lab, DIAL_2)  # what was interrupted can be done again
        assert whole(lab, True) == [*BOTH]
        if not os.WIFSIGNALED(status):
            assert os.waitstatus_to_exitcode(status) == 0
            assert changes > 5
            sys.stdout.write(f"publish: whole after each of {changes} deaths\n")
            return
    raise AssertionError("publishing never ended by itself")


BOTH = ("widgets/dial 1.0.0", "widgets/dial 2.0.0")


def put(lab: Path, made: Package) -> bool:
    said = made.manifest
    file = f"archives/{said.key}/{said.version}.zip"
    return take(lab, file, made.data, SIGNED.get(made.digest), sound).is_new


def put_and_die(lab: Path, changes: int) -> None:
    deadly = DeadlyOs(changes)
    atomic_files.os = deadly  # type: ignore[attr-defined,assignment]
    atomic_files.mkdtemp = deadly.deadly(atomic_files.mkdtemp)
    put(lab, DIAL_2)


def sound(document: Path) -> list[str]:
    assert document.is_file()
    return []


def whole(lab: Path, is_new: bool) -> list[str]:
    """Look at every byte that a client could ask for; return what is listed."""
    assert is_new
    index = read_index((lab / INDEX).read_bytes(), INDEX)
    for entry in index.packages:
        assert sha256((lab / entry.file).read_bytes()) == entry.sha256
        if entry.signed is not None:
            entry.signed.check(entry.key, entry.version, entry.sha256)
    read_head((lab / HEAD).read_bytes(), HEAD)
    return [str(entry) for entry in index.packages]


if __name__ == "__main__":
    home, how, *more = sys.argv[1:]
    atomic_files.os = DeadlyOs(-1)  # type: ignore[attr-defined,assignment]
    if how == "publish":
        anna = new_signer("Anna", Path(home) / "anna.pem")
        SIGNED[DIAL_2.digest] = anna.sign(DIAL_2.manifest.key, "2.0.0", DIAL_2.digest)
        publish(Path(home))
    elif how == "random":
        at_random(Path(home), int(more[0]), int(more[1]))
    else:
        steps(Path(home), how)
