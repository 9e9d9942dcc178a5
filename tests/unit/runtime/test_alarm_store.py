"""The file of alarms keeps states and history over restarts, within its bounds."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from urc.alarms.record import AlarmEvent, AlarmRecord
from urc.runtime import alarm_store
from urc.runtime.alarm_store import AlarmStore
from urc.runtime.alarm_table import AlarmQuery, alarm_file, load_records, search_alarms
from urc.runtime.backup_archive import parts_in

LOW = AlarmRecord(
    "battery", "low", "high", 3, 2, 1000.5, 7, value="15", is_acknowledged=True,
    acknowledged_at=1001.0, acknowledged_by="Ada", shelved_until=2000.0, shelved_by="Bob", times=4,
)  # fmt: skip


def event(number: int, kind: str = "raised", **more: object) -> AlarmEvent:
    return AlarmEvent(1000.0 + number, "battery", kind, "low", value=str(number), **more)  # type: ignore[arg-type]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "data" / "alarms.sqlite"


@pytest.fixture
def store(file: Path) -> Iterator[AlarmStore]:
    made = AlarmStore(file, most_events=50)
    yield made
    made.close()


def test_a_record_comes_back_as_it_was_and_goes_with_none(store: AlarmStore) -> None:
    assert store.load("rover") == []
    store.save("rover", {"battery": LOW}, [])
    store.save("puppet", {"battery": LOW._replace(number=9)}, [])
    assert store.settle()
    assert AlarmStore(store.file).load("rover") == [LOW]
    store.save("rover", {"battery": None}, [])
    assert store.settle()
    assert store.load("rover") == []
    assert [one.number for one in store.load("puppet")] == [9]


def test_the_newest_record_wins(store: AlarmStore) -> None:
    for number in range(200):
        store.save("rover", {"battery": LOW._replace(number=number)}, [])
    assert store.settle()
    assert [one.number for one in store.load("rover")] == [199]


def test_history_is_searched_and_paged(store: AlarmStore) -> None:
    events = [event(number) for number in range(10)]
    events += [event(10, "acknowledged", who="Ada_1"), event(11, "shelved", who="Ada", until=9e9)]
    store.save("rover", {}, events)
    store.save("puppet", {}, [event(99)])
    assert store.settle()

    def found(**query: object) -> list[float]:
        rows = search_alarms(store.file, AlarmQuery("rover", **query))  # type: ignore[arg-type]
        return [row.event.at - 1000 for row in rows]

    assert found() == [*range(11, -1, -1)]
    assert found(last=2) == [11, 10]
    second = search_alarms(store.file, AlarmQuery("rover", last=2))[-1].id
    assert found(before=second, last=2) == [9, 8]
    assert found(kinds=("acknowledged", "shelved")) == [11, 10]
    assert found(text="ada_") == [10], "_ is no wildcard"
    assert found(text="100%") == []
    assert found(text="Charge", signals=("battery",), last=1) == [11]
    assert found(since=1003, until=1005) == [4, 3]
    (row,) = search_alarms(store.file, AlarmQuery("puppet"))
    assert row.event == event(99)


def test_the_history_is_bounded(store: AlarmStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urc.runtime.alarm_table._SPARE", 10)
    for number in range(200):
        store.save("rover", {}, [event(number)])
        if number % 20 == 0:
            assert store.settle()
    assert store.settle()
    rows = search_alarms(store.file, AlarmQuery("rover", last=1000))
    assert 50 <= len(rows) <= 61
    assert rows[0].event == event(199)


def test_events_that_wait_are_bounded_and_counted(
    store: AlarmStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that takes nothing costs the oldest events, and says so."""
    monkeypatch.setattr(alarm_store, "MOST_WAITING", 5)
    monkeypatch.setattr(alarm_store, "_RETRY_S", 0.01)
    monkeypatch.setattr(alarm_store, "alarm_file", _refuse)
    store.save("rover", {"battery": LOW}, [event(number) for number in range(8)])
    assert not store.settle(0.2)
    assert (store.lost, store.fault) == (3, "the disk is full")
    monkeypatch.setattr(alarm_store, "alarm_file", alarm_file)
    assert store.settle()
    assert store.fault == ""
    assert len(search_alarms(store.file, AlarmQuery("rover"))) == 5
    assert store.load("rover") == [LOW]


def _refuse(_: Path) -> sqlite3.Connection:
    raise sqlite3.OperationalError("the disk is full")


def test_only_its_owner_reads_the_file(store: AlarmStore) -> None:
    store.save("rover", {"battery": LOW}, [event(1)])
    assert store.settle()
    for one in store.file.parent.iterdir():
        assert one.stat().st_mode & 0o077 == 0, one


def test_a_damaged_file_is_put_aside(store: AlarmStore) -> None:
    store.file.parent.mkdir()
    store.file.write_bytes(b"no database" * 1000)
    assert store.load("rover") == []
    store.save("rover", {"battery": LOW}, [])
    assert store.settle()
    assert store.load("rover") == [LOW]
    assert store.file.with_suffix(".broken").read_bytes().startswith(b"no database")


def test_a_damaged_record_is_left_out(store: AlarmStore) -> None:
    """One of a newer version has more attributes; one of a mad version has others."""
    store.save("rover", {"battery": LOW}, [])
    assert store.settle()
    with closing(sqlite3.connect(store.file)) as base, base:
        (text,) = base.execute("SELECT record FROM states").fetchone()
        newer = text[:-1] + ', "consequence": "It falls."}'
        for name, one in (("newer", newer), ("text", "{"), ("kind", '{"signal": 3}')):
            base.execute("INSERT INTO states VALUES ('rover', ?, ?)", (name, one))
    assert load_records(store.file) == [("rover", LOW)] * 2


def test_a_process_that_is_killed_loses_nothing_that_was_settled(file: Path) -> None:
    """The child dies without closing anything, as by kill -9."""
    child = os.fork()
    if child == 0:  # pragma: no cover - ends here
        store = AlarmStore(file)
        store.save("rover", {"battery": LOW}, [event(1, "acknowledged", who="Ada")])
        os._exit(0 if store.settle(10) else 1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    assert load_records(file) == [("rover", LOW)]
    (row,) = search_alarms(file, AlarmQuery("rover"))
    assert row.event.who == "Ada"


def test_a_backup_takes_the_alarms(store: AlarmStore) -> None:
    store.save("rover", {"battery": LOW}, [])
    assert store.settle()
    parts, unknown = parts_in(store.file.parent)
    assert (parts, unknown) == (["alarms.sqlite"], [])
