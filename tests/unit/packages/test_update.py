"""Newer versions: which there are, what they change, and the way back."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from tests.unit.packages.made import accepted, assert_whole, install, package
from urc.packages.index import IndexEntry
from urc.packages.install import plan_requirement
from urc.packages.lock import Lock
from urc.packages.names import PackageError, parse_requirement
from urc.packages.package import Package
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.packages.update import newer, plan_update, staged_difference

DIAL = package("widget", "dial", "1.0.0")
DIAL_11 = package("widget", "dial", "1.1.0")
DIAL_2 = package("widget", "dial", "2.0.0")
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "^1"})
BOT_11 = package("driver", "bot", "1.1.0", {"widgets/dial": "^1"})
BOT_2 = package("driver", "bot", "2.0.0", {"widgets/dial": "^2"})


class Seen(NamedTuple):
    permissions: list[str]
    wire: dict[str, str]
    risks: list[str]


def look(document: Path, folder: Path, widgets: Sequence[str]) -> Seen:
    """See a version as something that it may do, and as what it sends."""
    version = (document.parent / "package.yaml").read_text().partition("version: ")[2].split()[0]
    assert widgets == ["dial"]
    assert (folder / "widgets/dial/widget.js").is_file()
    wire = {"send": version, "port": "1"} | ({"more": "x"} if version == "2.0.0" else {})
    return Seen(["connects", f"is {version}"], wire, ["uses a key", f"runs {version}"])


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "packages")


def source(*packages: Package) -> FileSource:
    return FileSource("lab", packages, [packages[0].manifest.key])


def silent(line: str) -> None:
    raise AssertionError(line)


def update(store: Store, old: Lock, *packages: Package, wanted: str = "*") -> Lock:
    plan = plan_update(old, [source(*packages)], store, silent, wanted)
    assert plan is not None
    with store.changing() as change:
        change.stage(accepted(plan))
        change.replace(old, plan)
    return plan.lock


def test_updates_are_told_without_fetching_anything(store: Store) -> None:
    """What there is of what is installed, and nothing else."""
    install(store, BOT, DIAL)
    there = source(BOT_2, BOT, DIAL, DIAL_2, package("driver", "car"))
    (found,) = newer(store, [there], silent)
    assert (str(found.old), str(found.new)) == ("drivers/bot 1.0.0", "drivers/bot 2.0.0")
    assert found.lines == ["drivers/bot 1.0.0 → 2.0.0", "widgets/dial 1.0.0 → 2.0.0"]
    assert not store.has(BOT_2.digest)


def test_a_newer_part_of_the_same_version_is_an_update(store: Store) -> None:
    """The driver needs any dial of one kind, and that one was mended."""
    old = install(store, BOT, DIAL)
    (found,) = newer(store, [source(BOT, DIAL, DIAL_11)], silent)
    assert found.lines == ["widgets/dial 1.0.0 → 1.1.0"]
    new = update(store, old, BOT, DIAL, DIAL_11)
    assert assert_whole(store) == ["drivers/bot 1.0.0"]
    assert new.packages["widgets/dial"].version == "1.1.0"


@pytest.mark.parametrize("there", [(BOT, DIAL), (BOT, DIAL, DIAL_2)], ids=["same", "not needed"])
def test_nothing_newer_is_no_update(store: Store, there: tuple[Package, ...]) -> None:
    """Nor what does not fit."""
    old = install(store, BOT, DIAL)
    assert newer(store, [source(*there)], silent) == []
    assert plan_update(old, [source(*there)], store, silent) is None


def test_what_is_older_or_unfinished_is_no_update(store: Store) -> None:
    """A repository that lost its newest version takes it away from nobody."""
    old = install(store, BOT_11, DIAL_11)
    unfinished = package("driver", "bot", "3.0.0-rc.1", {"widgets/dial": "*"})
    assert newer(store, [source(BOT, DIAL, unfinished)], silent) == []
    assert plan_update(old, [source(BOT_11, DIAL)], store, silent) is None


def test_what_no_repository_has_is_told_when_it_is_named(store: Store) -> None:
    """It may have come from a memory stick; in a list it is passed over."""
    old = install(store, BOT, DIAL)
    other = source(package("driver", "car"))
    assert newer(store, [other], silent) == []
    with pytest.raises(PackageError, match="no repository has drivers/bot; the installed version"):
        plan_update(old, [other], store, silent)


def test_needs_that_collide_hold_up_that_update_alone(store: Store) -> None:
    """One line says why."""
    install(store, BOT, DIAL)
    install(store, package("driver", "car"))
    said: list[str] = []
    there = source(BOT_2, DIAL, package("driver", "car", "1.5.0"))
    assert [str(one.new) for one in newer(store, [there], said.append)] == ["drivers/car 1.5.0"]
    assert said == ["widgets/dial: drivers/bot 2.0.0 needs ^2; there is 1.0.0"]


def test_an_update_takes_the_place_of_the_old_version(store: Store) -> None:
    """A range limits it; what else is installed stays."""
    beside = install(store, BOT_2, DIAL_2)
    old = install(store, BOT, DIAL)
    new = update(store, old, BOT_11, BOT_2, DIAL, DIAL_2, wanted="^1")
    assert assert_whole(store) == ["drivers/bot 1.1.0", "drivers/bot 2.0.0"]
    assert store.previous(new) == old
    assert store.previous(beside) is None


def test_what_changes_is_shown_before(store: Store) -> None:
    """Versions, what it may do, and what goes to the robot."""
    old = install(store, BOT, DIAL)
    plan = plan_update(old, [source(BOT_2, DIAL_2)], store, silent)
    assert plan is not None
    with store.changing() as change:
        difference = staged_difference(old, plan, store, change.stage(accepted(plan)), look)
    assert difference.versions == ["drivers/bot 1.0.0 → 2.0.0", "widgets/dial 1.0.0 → 2.0.0"]
    assert (difference.gained, difference.lost) == (["is 2.0.0"], ["is 1.0.0"])
    assert difference.wire == ["- send: 1.0.0", "+ send: 2.0.0", "+ more: x"]
    assert assert_whole(store) == ["drivers/bot 1.0.0"]  # nobody agreed


def test_one_step_back_without_any_repository(store: Store) -> None:
    """And forth again; its files are there all the time."""
    old = install(store, BOT, DIAL)
    new = update(store, old, BOT_2, DIAL_2)
    assert store.place(old).is_dir()  # a dashboard may still be using it
    with store.changing() as change:
        assert change.back(new) == old
    assert assert_whole(store) == ["drivers/bot 1.0.0"]
    with store.changing() as change:
        assert change.back(old) == new
    assert assert_whole(store) == ["drivers/bot 2.0.0"]


def test_only_the_last_step_is_kept(store: Store) -> None:
    """What lies further back goes, as does all of it with the package."""
    first = install(store, BOT, DIAL)
    second = update(store, first, BOT_11, DIAL)
    third = update(store, second, BOT_2, DIAL_2)
    assert store.previous(third) == second
    assert not store.has(BOT.digest)
    assert not store.place(first).exists()
    with store.changing() as change:
        change.remove(parse_requirement("bot"))
    assert not store.has(BOT_11.digest)
    assert not store.has(BOT_2.digest)


def test_what_was_not_updated_has_no_way_back(store: Store) -> None:
    """One line."""
    old = install(store, BOT, DIAL)
    with (
        pytest.raises(PackageError, match=r"drivers/bot 1\.0\.0 has no update to undo"),
        store.changing() as change,
    ):
        change.back(old)


def test_other_bytes_of_the_version_to_go_back_to_are_refused(store: Store) -> None:
    """It is known as well as what is installed."""
    old = install(store, BOT, DIAL)
    update(store, old, BOT_2, DIAL_2)
    changed = package("widget", "dial", "1.0.0", notes="not the same")
    with pytest.raises(
        PackageError, match=r"widgets/dial 1\.0\.0 is already installed with different content"
    ):
        install(store, package("driver", "car", "1.0.0", {"widgets/dial": "^1"}), changed)


def test_an_index_that_tells_other_needs_than_the_package_is_found_out(store: Store) -> None:
    """Here it leaves out what the driver needs."""

    class Liar(FileSource):
        def entries(self) -> tuple[IndexEntry, ...]:
            return tuple(msgspec.structs.replace(one, needs={}) for one in super().entries())

    liar = Liar("lab", [BOT], [BOT.manifest.key])
    plan = plan_requirement(parse_requirement("bot"), [liar], store, silent)
    with (
        pytest.raises(
            PackageError, match=r"needs widgets/dial \^1, but this dependency is not in the lock"
        ),
        store.changing() as change,
    ):
        change.stage(accepted(plan))
    assert assert_whole(store) == []
