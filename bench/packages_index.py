"""Ten thousand packages: search and resolve beside SQLite over the same rows, and what is sent.

Processor times of the whole step as the verbs take it: `search` and `resolve` once the index is in
memory, and once from its file. SQLite has the rows in a file of its own, with an index on their
names, and is asked the same: the newest version of each package that has the words, or every
version of every package that can be reached.
"""

import json
import sqlite3
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

from bench.figures import tell
from bench.harness import Goal, Result, compare_all
from urc.packages.changes import change_file, write_index
from urc.packages.index import INDEX, Entry, Index, read_index, search
from urc.packages.install import settle
from urc.packages.names import Key, PackageError, parse_wish
from urc.packages.resolver import choose
from urc.packages.sources import merged

__all__ = ["run"]

PACKAGES = 10_000
ROUNDS, ROUNDS_IF_FULL = 7, 21
SEARCH_S, RESOLVE_S = 0.050, 0.200
SEARCH_GOAL, RESOLVE_GOAL = 12.0, 60.0
WORDS = ("arm", "rover", "gripper", "battery", "camera", "lidar", "boat", "drone", "oven", "valve")
WISH = "robots/all-of-it"


class _Source:
    """A repository that has answered already."""

    name = "bench"

    def __init__(self, index: Index) -> None:
        self._index = index

    def entries(self) -> tuple[Entry, ...]:
        return self._index.packages

    def fetch(self, entry: Entry) -> bytes:
        raise PackageError("nothing is fetched here")


def run(*, full: bool) -> Sequence[Result]:
    """Compare search and resolve with SQLite and with what was promised."""
    rounds = ROUNDS_IF_FULL if full else ROUNDS
    with tempfile.TemporaryDirectory(prefix="urc-bench-") as name:
        folder = Path(name)
        entries = _entries()
        index = write_index(folder, "bench", entries, folder / ".work")
        _tell_bytes(folder, index, entries)
        database = _database(folder / "rows.sqlite", index)
        try:
            results = _compare(folder, index, database, rounds)
        finally:
            database.close()
    return results


def _compare(folder: Path, index: Index, database: sqlite3.Connection, rounds: int) -> list[Result]:
    def from_file() -> Index:
        return read_index((folder / INDEX).read_bytes(), INDEX)

    found = {len(_search(index)), len(_search_rows(database))}
    reached = _reached_rows(database)
    if len(found) != 1 or not {str(key) for key in _resolve(index)} <= reached:
        raise SystemExit("bench: SQLite and URC found different packages")
    results = []
    for what, subject, baseline, limit_s, goal in (
        ("search", _search, _search_rows, SEARCH_S, SEARCH_GOAL),
        ("resolve", _resolve, _reached_rows, RESOLVE_S, RESOLVE_GOAL),
    ):
        results += compare_all(
            [
                (Goal(f"{what}, {PACKAGES} packages / SQLite", goal), _timed(baseline, database)),
                (Goal(f"{what}, {PACKAGES} packages / {limit_s:g} s", 1.0), _always(limit_s)),
            ],
            _timed(subject, index),
            rounds=rounds,
        )
        cold = compare_all(
            [(Goal(f"{what} from the file / {limit_s:g} s", 4.0), _always(limit_s))],
            _timed(_of_file(subject, from_file), None),
            rounds=rounds,
        )
        results += cold
    return results


def _always(seconds: float) -> Callable[[], float]:
    return lambda: seconds


def _of_file(
    subject: Callable[[Index], object], from_file: Callable[[], Index]
) -> Callable[[object], object]:
    return lambda _: subject(from_file())


def _timed(work: Callable[[Any], object], given: object) -> Callable[[], float]:
    def measure() -> float:
        began = time.process_time()
        work(given)
        return time.process_time() - began

    return measure


# ---- URC


def _search(index: Index) -> list[Entry]:
    return search(index.packages, ["battery", "rover"])


def _resolve(index: Index) -> dict[Key, Entry]:
    found = merged([_Source(index)], print)
    wish = parse_wish(WISH)
    root = choose({key: [entry for entry, _ in some] for key, some in found.items()}, wish)
    return settle(root, wish.range, found)


# ---- SQLite


def _database(file: Path, index: Index) -> sqlite3.Connection:
    database = sqlite3.connect(file)
    database.execute("CREATE TABLE rows (key TEXT, kind, name, version, place, summary, needs)")
    database.executemany(
        "INSERT INTO rows VALUES (?, ?, ?, ?, ?, ?, ?)",
        (
            (
                str(one.key),
                one.kind,
                one.name,
                one.version,
                place,
                one.summary,
                json.dumps(one.needs),
            )
            for place, one in enumerate(index.packages)
        ),
    )
    database.execute("CREATE INDEX keys ON rows (key)")
    database.commit()
    return database


def _search_rows(database: sqlite3.Connection) -> list[tuple[str, ...]]:
    text = "kind || ' ' || name || ' ' || summary"
    words = f"{text} LIKE '%battery%' AND {text} LIKE '%rover%'"
    query = f"SELECT key, version, max(place) FROM rows WHERE {words} GROUP BY key ORDER BY name"  # noqa: S608
    return database.execute(query).fetchall()


def _reached_rows(database: sqlite3.Connection) -> set[str]:
    """Return what can be reached from the wish, each version of it having been read."""
    reached, left = {WISH}, [WISH]
    while left:
        query = "SELECT version, needs FROM rows WHERE key = ?"
        for _, needs in database.execute(query, (left.pop(),)).fetchall():
            fresh = [key for key in json.loads(needs) if key not in reached]
            reached.update(fresh)
            left += fresh
    return reached


# ---- rows


def _entries() -> list[Entry]:
    """Return some 15 000 versions of packages that need each other as real ones do."""
    chance = Random(7)  # noqa: S311 (rows, not secrets)
    names = {kind: [f"{_word(chance)}-{_word(chance)}-{number}" for number in range(share)]
             for kind, share in (("widget", 4000), ("interface", 2000), ("driver", 3000),
                                 ("robot", 999))}  # fmt: skip
    entries = []
    for kind, some in names.items():
        for name in some:
            for version in ("1.0.0", "1.1.0", "2.0.0")[: chance.choice((1, 1, 2))]:
                entries.append(_entry(chance, kind, name, version, _needs(chance, kind, names)))
    drivers = chance.sample(names["driver"], 12)
    needs = {f"drivers/{name}": "*" for name in drivers}
    return [*entries, _entry(chance, "robot", WISH.partition("/")[2], "1.0.0", needs)]


def _needs(chance: Random, kind: str, names: dict[str, list[str]]) -> dict[str, str]:
    if kind == "driver":
        return {f"widgets/{name}": chance.choice(("*", "^1", ">=1.0, <3"))
                for name in chance.sample(names["widget"], 8)}  # fmt: skip
    if kind == "robot":
        return {f"drivers/{chance.choice(names['driver'])}": "*",
                f"interfaces/{chance.choice(names['interface'])}": "^1"}  # fmt: skip
    return {}


def _entry(chance: Random, kind: str, name: str, version: str, needs: dict[str, str]) -> Entry:
    summary = f"The {kind} for {' and '.join(_word(chance) for _ in range(6))}, as it is used here."
    digest = f"{chance.getrandbits(256):064x}"
    return Entry(kind, name, version, digest, 12345, 1, "MIT", ("A. Author",), summary, needs)


def _word(chance: Random) -> str:
    return chance.choice(WORDS)


def _tell_bytes(folder: Path, index: Index, entries: list[Entry]) -> None:
    """Tell what a client is sent that has the index before: one package more, and ten."""
    whole = (folder / INDEX).stat().st_size
    chance = Random(8)  # noqa: S311
    figures: dict[str, object] = {"figure": "index", "versions": len(entries), "whole_bytes": whole}
    for more in (1, 10):
        fresh = [_entry(chance, "widget", f"fresh-{more}-{at}", "1.0.0", {}) for at in range(more)]
        new = write_index(folder, "bench", [*entries, *fresh], folder / ".work")
        figures[f"change_of_{more}_bytes"] = (folder / change_file(new.number)).stat().st_size
        write_index(folder, "bench", entries, folder / ".work")
    tell(figures)
