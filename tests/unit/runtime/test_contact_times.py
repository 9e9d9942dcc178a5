"""The times of the last use and the last data of robots: bounded, and kept over a restart."""

import logging
from pathlib import Path

import pytest

from urc.runtime.contact_times import MOST_ROBOTS, ContactStore, ContactTimes


def test_the_times_survive_a_restart(tmp_path: Path) -> None:
    file = tmp_path / "contact-times.json"
    store = ContactStore(file)
    assert store.of("rover") == ContactTimes(None, None)
    store.note("rover", 100.0, is_used=True, is_seen=False)
    store.note("rover", 101.0, is_used=False, is_seen=True)
    store.note("arm", 102.0, is_used=False, is_seen=False)
    store.save()
    again = ContactStore(file)
    assert again.of("rover") == ContactTimes(used_at=100.0, seen_at=101.0)
    assert again.of("arm") == ContactTimes()


def test_nothing_is_written_without_a_change(tmp_path: Path) -> None:
    file = tmp_path / "times.json"
    store = ContactStore(file)
    store.save()
    assert not file.exists()
    store.note("rover", 1.0, is_used=True, is_seen=False)
    store.save()
    file.unlink()
    store.save()
    assert not file.exists()


def test_the_oldest_robot_goes_first(tmp_path: Path) -> None:
    store = ContactStore(tmp_path / "times.json")
    for number in range(MOST_ROBOTS + 2):
        store.note(f"r{number}", 10.0 + number, is_used=True, is_seen=False)
    store.save()
    again = ContactStore(tmp_path / "times.json")
    assert again.of("r0") == again.of("r1") == ContactTimes()
    assert again.of("r2").used_at == 12.0
    assert again.of(f"r{MOST_ROBOTS + 1}").used_at == 11.0 + MOST_ROBOTS


@pytest.mark.parametrize("text", ["", "{", '{"robots": {"a": [1]}}', '{"format": 2}', "[[" * 5000])
def test_a_damaged_file_is_reported_and_replaced(
    tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "times.json"
    file.write_text(text)
    with caplog.at_level(logging.WARNING):
        store = ContactStore(file)
    assert "cannot be read" in caplog.text
    store.note("rover", 5.0, is_used=True, is_seen=False)
    store.save()
    assert ContactStore(file).of("rover").used_at == 5.0


def test_a_failed_write_is_retried(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "folder").write_text("a file in the way")
    store = ContactStore(tmp_path / "folder" / "times.json")
    store.note("rover", 5.0, is_used=True, is_seen=False)
    with caplog.at_level(logging.WARNING):
        store.save()
    assert "times.json" in caplog.text
    (tmp_path / "folder").unlink()
    store.save()
    assert ContactStore(tmp_path / "folder" / "times.json").of("rover").used_at == 5.0


def test_emulated_robots_have_times_of_their_own() -> None:
    store = ContactStore()
    real, emulated = (ContactStore.key("rover", is_emulated=one) for one in (False, True))
    store.note(emulated, 7.0, is_used=True, is_seen=True)
    store.save()
    assert store.of(real) == ContactTimes()
    assert store.of(emulated) == ContactTimes(7.0, 7.0)
