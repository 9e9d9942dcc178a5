"""The audit is searched by robot, person, kind, text and time, page by page, within a time."""

from pathlib import Path

import pytest

from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, SearchTimeout, search
from urc.runtime.sqlite_file import open_for_writing


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("audit") / "audit.sqlite"
    with AuditLog(path) as log:
        for number, (robot, what, who, text) in enumerate(ENTRIES):
            log.add(
                AuditEntry(
                    1000.0 + number, robot, what, who, command=text, principal=f"id-{who}",
                    place=f"192.0.2.{number}",
                )
            )  # fmt: skip
    return path


ENTRIES = [
    ("puppet", "moved", "Ann", "go"),
    ("rover", "moved", "Ben", "go"),
    ("", "signed in", "Ann", "100% sure_"),
    ("rover", "STOP", "Ann", ""),
    ("", "lost", "", ""),
    ("puppet", "ran", "Annabel", "dance"),
]


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        (AuditQuery(), [5, 4, 3, 2, 1, 0]),
        (AuditQuery(last=2), [5, 4]),
        (AuditQuery(before=4, last=2), [2, 1]),
        (AuditQuery(robot="rover"), [4, 3, 1]),
        (AuditQuery(robots=frozenset({"puppet"})), [5, 0]),
        (AuditQuery(robots=frozenset({"puppet"}), robot="rover"), []),
        (AuditQuery(robots=frozenset()), []),
        (AuditQuery(who="ann"), [5, 3, 2, 0]),
        (AuditQuery(who="id-Ann"), [3, 2, 0]),
        (AuditQuery(who="192.0.2.1"), [1]),
        (AuditQuery(what=("STOP", "ran")), [5, 3]),
        (AuditQuery(text="GO"), [1, 0]),
        (AuditQuery(text="0% s"), [2]),
        (AuditQuery(text="sure_"), [2]),
        (AuditQuery(text="sureX"), []),
        (AuditQuery(text="' OR 1=1 --"), []),
        (AuditQuery(since=1001.0, until=1003.0), [2, 1]),
    ],
)
def test_query_finds(file: Path, query: AuditQuery, wanted: list[int]) -> None:
    assert [round(row.entry.at - 1000) for row in search(file, query)] == wanted


def test_search_without_a_file_finds_nothing(tmp_path: Path) -> None:
    assert search(tmp_path / "audit.sqlite", AuditQuery()) == []


def test_search_in_a_file_that_a_server_is_creating_finds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "audit.sqlite"
    open_for_writing(path).close()
    assert search(path, AuditQuery()) == []


def test_search_ends_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urc.runtime.audit_search._STEPS", 1)
    path = tmp_path / "audit.sqlite"
    with AuditLog(path) as log:
        log.add(AuditEntry(1.0, "puppet", "moved"))
        assert log.settle()
        with pytest.raises(SearchTimeout, match="choose a shorter period"):
            search(path, AuditQuery(text="nothing"), longest_s=0.0)
