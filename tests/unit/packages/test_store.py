"""The store: whole at every moment, several versions side by side, nothing taken from others."""

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.unit.packages.made import accepted, assert_whole, install, package
from urc.packages import atomic_files
from urc.packages.install_plan import InstallPlan
from urc.packages.lock import LOCK, read_lock
from urc.packages.names import PackageError, parse_requirement
from urc.packages.sources import FileSource
from urc.packages.store import Store, ecosystem_of
from urc.packages.update import plan_update

DIAL = package("widget", "dial", "1.0.0")
DIAL_2 = package("widget", "dial", "2.0.0")
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "^1"})
BOT_2 = package("driver", "bot", "2.0.0", {"widgets/dial": "^2"})
CAR = package("driver", "car", "1.0.0", {"widgets/dial": "*"})


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "packages")


def remove(store: Store, word: str) -> list[str]:
    with store.changing() as change:
        return change.remove(parse_requirement(word))[1]


def files_below(folder: Path) -> list[str]:
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


def test_a_new_store_is_empty_and_makes_nothing(store: Store) -> None:
    """Looking leaves no trace."""
    assert store.installed() == ()
    assert store.find(parse_requirement("bot")) is None
    assert not store.folder.exists()


def test_a_package_brings_all_it_needs(store: Store) -> None:
    """Its files stand as in a repository, with a lock that has every hash."""
    lock = install(store, BOT, DIAL, DIAL_2)
    place = store.place(lock)
    assert files_below(place) == [
        "drivers/bot/driver.yaml", "drivers/bot/package.yaml", "urc.lock",
        "widgets/dial/package.yaml", "widgets/dial/template.html.j2", "widgets/dial/widget.js",
        "widgets/dial/widget.yaml",
    ]  # fmt: skip
    kept = read_lock((place / LOCK).read_bytes(), "lock")
    assert kept == lock
    assert {key: pin.sha256 for key, pin in kept.packages.items()} == {
        "drivers/bot": BOT.digest, "widgets/dial": DIAL.digest,
    }  # fmt: skip
    assert ecosystem_of(store.document(lock)) == place
    assert ecosystem_of(Path("robots/puppet.yaml")) is None


def test_versions_live_side_by_side_each_with_its_own(store: Store) -> None:
    """The newest is meant where none is named."""
    old, new = install(store, BOT, DIAL, DIAL_2), install(store, BOT_2, DIAL, DIAL_2)
    assert assert_whole(store) == ["drivers/bot 1.0.0", "drivers/bot 2.0.0"]
    assert store.find(parse_requirement("bot")) == new
    assert store.find(parse_requirement("bot@1.0.0")) == old
    assert (store.place(old) / "widgets/dial/package.yaml").read_bytes() == DIAL.files[
        "package.yaml"
    ]
    assert (store.place(new) / "widgets/dial/package.yaml").read_bytes() != DIAL.files[
        "package.yaml"
    ]


def test_removal_takes_what_only_it_needed(store: Store) -> None:
    """To the last file."""
    install(store, BOT, DIAL)
    assert remove(store, "bot") == ["drivers/bot 1.0.0", "widgets/dial 1.0.0"]
    assert files_below(store.folder) == ["changing", "state.json"]


def test_removal_never_touches_what_another_needs(store: Store) -> None:
    """Neither a shared widget, nor one that was asked for by itself."""
    install(store, BOT, DIAL)
    car = install(store, CAR, DIAL)
    assert remove(store, "drivers/bot") == ["drivers/bot 1.0.0"]
    assert assert_whole(store) == ["drivers/car 1.0.0"]
    install(store, DIAL)
    assert remove(store, "dial") == []
    assert store.document(car).is_file()
    with pytest.raises(PackageError) as told:
        remove(store, "dial")
    assert str(told.value) == (
        "dial was installed only as a dependency: drivers/car 1.0.0 needs widgets/dial 1.0.0"
    )


def test_one_version_alone_can_be_removed(store: Store) -> None:
    """The other stays, whole."""
    install(store, BOT, DIAL, DIAL_2)
    install(store, BOT_2, DIAL, DIAL_2)
    assert remove(store, "bot@2.0.0") == ["drivers/bot 2.0.0", "widgets/dial 2.0.0"]
    assert assert_whole(store) == ["drivers/bot 1.0.0"]


def test_removing_what_is_not_there_is_told(store: Store) -> None:
    """With what there is."""
    with pytest.raises(PackageError, match="bot is not installed; installed: nothing"):
        remove(store, "bot")
    install(store, CAR, DIAL)
    with pytest.raises(PackageError, match=r"bot is not installed; installed: drivers/car 1\.0\.0"):
        remove(store, "bot")


def test_other_bytes_under_a_known_version_are_refused(store: Store) -> None:
    """A repository that changes a version silently is found out."""
    install(store, BOT, DIAL)
    before = files_below(store.folder)
    changed = package("widget", "dial", "1.0.0", notes="not the same")
    with pytest.raises(
        PackageError, match=r"widgets/dial 1\.0\.0 is already installed with different content"
    ):
        install(store, CAR, changed)
    assert files_below(store.folder) == before
    assert assert_whole(store) == ["drivers/bot 1.0.0"]


def test_bytes_that_are_not_those_of_the_lock_are_refused(store: Store) -> None:
    """Whoever handed them over."""
    lock = install(Store(store.folder.parent / "other"), BOT, DIAL)
    with (
        pytest.raises(PackageError, match="the archive does not match the digest in the lock"),
        store.changing() as change,
    ):
        change.stage(
            accepted(InstallPlan(lock, {BOT.digest: BOT.data, DIAL.digest: DIAL_2.data}, {}, {}))
        )
    assert store.installed() == ()
    assert files_below(store.folder) == ["changing"]


def test_what_was_staged_but_not_agreed_to_is_gone(store: Store) -> None:
    """Somebody looked at the permissions and said no."""
    lock = install(Store(store.folder.parent / "other"), BOT, DIAL)
    with store.changing() as change:
        plan = InstallPlan(lock, {BOT.digest: BOT.data, DIAL.digest: DIAL.data}, {}, {})
        assert change.stage(accepted(plan)).is_dir()
    assert files_below(store.folder) == ["changing"]


@pytest.mark.parametrize("harm", ["change", "add", "delete", "link", "all"])
def test_files_that_were_changed_are_made_anew(store: Store, harm: str) -> None:
    """What is opened is what was agreed to."""
    lock = install(store, BOT, DIAL)
    place = store.place(lock)
    widget = place / "widgets/dial/widget.js"
    good = widget.read_bytes()
    if harm == "change":
        widget.write_bytes(b"#" * len(good))
    elif harm == "add":
        (place / "drivers/bot/more.yaml").write_text("urc: 1\n")
    elif harm == "delete":
        widget.unlink()
    elif harm == "link":
        widget.unlink()
        widget.symlink_to("/etc/hostname")
    else:
        shutil.rmtree(place)
    assert store.document(lock).is_file()
    assert widget.read_bytes() == good
    assert len(files_below(place)) == 7


def test_a_damaged_archive_is_told_and_installing_again_mends_it(store: Store) -> None:
    """Never used, never silently passed over."""
    lock = install(store, BOT, DIAL)
    blob = store.blob_file(DIAL.digest)
    blob.write_bytes(blob.read_bytes()[:-1])
    with pytest.raises(PackageError, match="this archive is missing or damaged; install it again"):
        store.document(lock)
    install(store, BOT, DIAL)
    assert assert_whole(store) == ["drivers/bot 1.0.0"]


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 2, "installed": []}', "\xff"])
def test_a_damaged_state_is_one_line(store: Store, text: str) -> None:
    """It names the file."""
    store.folder.mkdir(parents=True)
    (store.folder / "state.json").write_text(text, encoding="latin-1")
    with pytest.raises(PackageError, match=r"state\.json: this file is damaged: "):
        store.installed()


class _FullDisk:
    """`os` on a disk that is full from the n-th change on."""

    def __init__(self, changes: int) -> None:
        self.left = changes
        self.was_full = False

    def __getattr__(self, name: str) -> Any:
        found = getattr(os, name)
        return self.limited(found) if name in ("write", "fsync", "replace", "open") else found

    def limited(self, found: Callable[..., Any]) -> Callable[..., Any]:
        def change(*words: Any, **more: Any) -> Any:
            self.left -= 1
            if self.left < 0:
                self.was_full = True
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return found(*words, **more)

        return change


def update(store: Store) -> None:
    old = store.find(parse_requirement("bot"))
    assert old is not None
    plan = plan_update(old, [FileSource("lab", [BOT_2, DIAL_2], [old.key])], store, print)
    assert plan is not None
    with store.changing() as change:
        change.stage(accepted(plan))
        change.replace(old, plan)


def back(store: Store) -> None:
    new = store.find(parse_requirement("bot"))
    assert new is not None
    with store.changing() as change:
        change.back(new)


ACTS: dict[str, Callable[[Store], object]] = {
    "install": lambda store: install(store, BOT, DIAL),
    "update": update,
    "back": back,
    "remove": lambda store: remove(store, "bot"),
}


@pytest.mark.parametrize("act", ["install", "update", "back", "remove"])
def test_a_disk_that_gets_full_at_any_moment_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: str
) -> None:
    """At every write, flush, rename and new file, one after the other."""
    outcomes = set()
    first = Store(tmp_path / "first")
    install(first, CAR, DIAL)
    if act != "install":
        install(first, BOT, DIAL)
    if act == "back":
        update(first)
    before = assert_whole(first)
    for changes in range(200):
        store = Store(tmp_path / f"{act}-{changes}")
        shutil.copytree(first.folder, store.folder)
        full = _FullDisk(changes)
        with monkeypatch.context() as patch:
            patch.setattr(atomic_files, "os", full)
            patch.setattr(atomic_files, "mkdtemp", full.limited(atomic_files.mkdtemp))
            try:
                ACTS[act](store)
                outcomes.add("done")
            except OSError as error:
                outcomes.add("refused" if error.errno == errno.ENOSPC else str(error))
        after = assert_whole(store)
        assert "drivers/car 1.0.0" in after
        assert set(after) <= {"drivers/car 1.0.0", "drivers/bot 1.0.0", "drivers/bot 2.0.0"}
        assert act not in ("update", "back") or len(after) == 2  # one version or the other
        if not full.was_full:
            assert after != before
            break
    assert outcomes == {"done", "refused"}
    assert not full.was_full


def test_a_second_process_is_kept_out(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a bounded wait, in one line."""
    monkeypatch.setattr(atomic_files, "_WAIT_S", 0.0)
    with (
        store.changing(),
        pytest.raises(PackageError, match="another URC process is changing packages; try again"),
        store.changing(),
    ):
        pass
