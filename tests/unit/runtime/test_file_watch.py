"""Waiting for files: a change, a coming and a going are seen; half a file is not taken for one."""

import os
from pathlib import Path

from urc.runtime.file_watch import FileWatcher, wait_for_change


class Sleeps:
    """Does one thing at each sleep, in place of waiting."""

    def __init__(self, *steps: object) -> None:
        self.steps = list(steps)
        self.count = 0

    def __call__(self, seconds: float) -> None:
        assert 0 < seconds < 1
        self.count += 1
        step = self.steps.pop(0) if self.steps else None
        if callable(step):
            step()


def test_change_is_seen_once_the_file_is_left_alone(tmp_path: Path) -> None:
    """A file that grows at every look is waited for."""
    file = tmp_path / "a.yaml"
    file.write_text("a")
    sleeps = Sleeps(None, lambda: file.write_text("ab"), lambda: file.write_text("abc"))
    assert wait_for_change(FileWatcher([str(file)]), sleeps) == [str(file)]
    assert sleeps.count == 4
    assert file.read_text() == "abc"


def test_file_that_comes_or_goes_has_changed(tmp_path: Path) -> None:
    """A document that was missing is looked for, too."""
    there, missing = tmp_path / "there.yaml", tmp_path / "missing.yaml"
    there.write_text("a")
    watched = FileWatcher([str(there), str(missing)])
    assert watched.changed() == []
    missing.write_text("b")
    there.unlink()
    assert watched.changed() == [str(there), str(missing)]


def test_file_that_is_replaced_by_one_of_the_same_size_has_changed(tmp_path: Path) -> None:
    """So editors save; the time may even be kept."""
    file, other = tmp_path / "a.yaml", tmp_path / "b.yaml"
    file.write_text("a")
    other.write_text("b")
    watched = FileWatcher([str(file)])
    status = file.stat()
    os.utime(other, ns=(status.st_atime_ns, status.st_mtime_ns))
    other.replace(file)
    assert watched.changed() == [str(file)]


def test_file_added_later_counts_from_then_on(tmp_path: Path) -> None:
    """What was watched before keeps the state that it had."""
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text("a")
    watched = FileWatcher([str(first)])
    first.write_text("changed")
    second.write_text("b")
    watched.add([str(first), str(second)])
    assert watched.changed() == [str(first)]
