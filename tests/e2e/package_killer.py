"""Kills processes that change a store, and looks at what is left. Run as a program of its own.

A process that forks must have no threads, which a test runner has:
``python -m tests.e2e.package_killer FOLDER add|update|remove`` or ``… FOLDER random ROUNDS SEED``.
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

from tests.unit.packages.made import assert_whole, install, package
from urc.packages import disk
from urc.packages.names import PackageError, parse_wish
from urc.packages.store import Store

DIAL = package("widget", "dial", "1.0.0")
DIAL_2 = package("widget", "dial", "2.0.0", big="x" * 200_000)
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "^1"})
BOT_2 = package("driver", "bot", "2.0.0", {"widgets/dial": "^2"})
CAR = package("driver", "car", "1.0.0", {"widgets/dial": "*"})
BOTS = {"drivers/bot 1.0.0", "drivers/bot 2.0.0"}


def add(store: Store) -> None:
    install(store, BOT, DIAL, DIAL_2)


def update(store: Store) -> None:
    """Put the newer version beside the older one, then take that away."""
    install(store, BOT_2, DIAL, DIAL_2)
    remove(store, "bot@1.0.0")


def remove(store: Store, word: str = "bot") -> None:
    with store.changing() as change:
        try:
            change.remove(parse_wish(word))
        except PackageError as error:
            if "is not installed" not in str(error):
                raise


ACTS: dict[str, Callable[[Store], None]] = {"add": add, "update": update, "remove": remove}


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
    disk.os = deadly  # type: ignore[attr-defined,assignment]
    disk.mkdtemp = deadly.deadly(disk.mkdtemp)
    ACTS[act](store)


def steps(folder: Path, act: str) -> None:
    """Die at every single change of the disk that an act makes."""
    for changes in range(500):
        store = Store(folder / f"{act}-{changes}")
        install(store, CAR, DIAL)
        if act != "add":
            add(store)
        child = forked(lambda store=store, at=changes: die_at(store, act, at))
        status = os.waitpid(child, 0)[1]
        left = set(assert_whole(store))
        assert "drivers/car 1.0.0" in left, left
        assert left <= BOTS | {"drivers/car 1.0.0"}, left
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


if __name__ == "__main__":
    home, how, *more = sys.argv[1:]
    disk.os = DeadlyOs(-1)  # type: ignore[attr-defined,assignment]
    if how == "random":
        at_random(Path(home), int(more[0]), int(more[1]))
    else:
        steps(Path(home), how)
