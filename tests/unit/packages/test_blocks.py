"""Blocked packages: a signed list stops the installation and the use of what it names."""

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from tests.unit.packages.made import install, package, write_package
from tests.unit.packages.test_index_updates import URL, Web
from tests.unit.packages.test_signature import sign
from urc.packages import repositories
from urc.packages.block_builder import block, export_blocks, unblock
from urc.packages.block_store import BlockStore
from urc.packages.blocks import Block, BlockList, read_block_file, sign_blocks
from urc.packages.index import INDEX
from urc.packages.index_builder import make_index
from urc.packages.index_head import IndexSigner
from urc.packages.install import plan_requirement
from urc.packages.lock import Lock
from urc.packages.names import PackageError, PackageId, parse_requirement
from urc.packages.repositories import Repository
from urc.packages.signature import Signer, new_signer
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.packages.update import newer, plan_update
from urc.runtime.open_profile import open_document

WHY = "It turns the wrong way."
DIAL = package("widget", "dial", "1.0.0")
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "*"})
BOT_2 = package("driver", "bot", "1.1.0", {"widgets/dial": "*"})
BOT_3 = package("driver", "bot", "1.2.0-rc.1", {"widgets/dial": "*"})
ID = "0123456789abcdef" * 2


@pytest.fixture
def anna(tmp_path: Path) -> Signer:
    return new_signer("Anna", tmp_path / "anna.pem")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "data" / "packages")


def know(store: Store, by: Signer, *blocks: Block, number: int = 1, list_id: str = ID) -> None:
    store.blocks.keep(by, number, BlockList(list_id, blocks), "test")


def told(store: Store, lock: Lock) -> str:
    (line,) = store.blocked(lock)
    return line


@pytest.mark.parametrize(
    "entry",
    [
        Block(WHY, "drivers/bot"),
        Block(WHY, "drivers/bot", "<1.1"),
        Block(WHY, sha256=BOT.digest),
    ],
)
def test_a_blocked_package_is_neither_installed_nor_used(
    store: Store, anna: Signer, entry: Block
) -> None:
    lock = install(store, BOT, DIAL)
    document = store.document(lock)
    know(store, anna, entry)
    line = f"drivers/bot 1.0.0 is blocked by Anna: {WHY}"
    assert told(store, lock) == line
    for use in (
        lambda: store.document(lock),
        lambda: open_document(document),
        lambda: install(store, BOT, DIAL),
    ):
        with pytest.raises(PackageError) as refused:
            use()
        assert str(refused.value) == line


def test_a_blocked_dependency_blocks_the_package(store: Store, anna: Signer) -> None:
    lock = install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "widgets/dial"))
    assert told(store, lock) == f"widgets/dial 1.0.0 is blocked by Anna: {WHY}"


def test_a_stolen_key_blocks_all_packages_of_its_signer(store: Store, anna: Signer) -> None:
    lock = install(store, BOT, DIAL, signatures=sign(anna, DIAL))
    know(store, anna, Block(WHY, key=anna.fingerprint))
    assert told(store, lock) == f"widgets/dial 1.0.0 is blocked by Anna: {WHY}"


def test_other_versions_and_packages_stay_usable(store: Store, anna: Signer) -> None:
    know(store, anna, Block(WHY, "drivers/bot", "<1.1"), Block(WHY, "drivers/dial"))
    assert store.blocked(install(store, BOT_2, DIAL)) == []


def test_a_range_blocks_pre_releases_within_its_bounds(store: Store, anna: Signer) -> None:
    """Requirements skip pre-releases; a block list must not."""
    lock = install(store, BOT_3, DIAL)
    know(store, anna, Block(WHY, "drivers/bot", "<1.3"))
    assert told(store, lock).startswith("drivers/bot 1.2.0-rc.1 is blocked")


def test_a_blocked_version_is_no_update_and_no_choice(store: Store, anna: Signer) -> None:
    """An older version is chosen if the range allows it; the reason stands in the refusal."""
    know(store, anna, Block(WHY, "drivers/bot", "1.1.0"))
    lab = FileSource("lab", [BOT, BOT_2, DIAL], [BOT.manifest.key])
    plan = plan_requirement(parse_requirement("bot"), [lab], store, print)
    assert plan.lock.version == "1.0.0"
    with pytest.raises(PackageError, match=f"drivers/bot 1.1.0 is blocked by Anna: {WHY}"):
        plan_requirement(parse_requirement("bot@1.1.0"), [lab], store, print)
    old = install(store, BOT, DIAL)
    assert newer(store, [lab], print) == []
    assert plan_update(old, [lab], store, print) is None


def test_a_blocked_version_is_left_by_an_update_and_not_restored(
    store: Store, anna: Signer
) -> None:
    old = install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "drivers/bot", "1.0.0"))
    lab = FileSource("lab", [BOT, BOT_2, DIAL], [BOT.manifest.key])
    plan = plan_update(old, [lab], store, print)
    assert plan is not None
    with store.changing() as change:
        change.stage(plan._replace(waived=frozenset(plan.lock.packages)))
        change.replace(old, plan)
    assert store.document(plan.lock).is_file()
    with pytest.raises(PackageError, match="is blocked by Anna"), store.changing() as change:
        change.back(plan.lock)


def test_a_blocked_package_can_be_removed(store: Store, anna: Signer) -> None:
    install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "drivers/bot"))
    with store.changing() as change:
        change.remove(parse_requirement("bot"))
    assert store.installed() == ()


def test_only_a_newer_list_of_the_same_key_withdraws_an_entry(
    store: Store, anna: Signer, tmp_path: Path
) -> None:
    mallory = new_signer("Anna", tmp_path / "mallory.pem")
    lock = install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "drivers/bot"), number=5)
    know(store, mallory, number=9)  # another key, although the same name and list
    know(store, anna, number=9, list_id="f" * 32)  # another repository of the same maintainer
    for number in (4, 5):
        with pytest.raises(PackageError, match=rf"has number {number}, but number 5 by Anna"):
            know(store, anna, number=number)
    assert store.blocked(lock)
    know(store, anna, number=6)
    assert store.blocked(lock) == []


def test_a_forgotten_key_blocks_nothing(store: Store, anna: Signer) -> None:
    lock = install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "drivers/bot"))
    with pytest.raises(PackageError, match=r"no block list is signed by SHA256:x; .*Anna \(SHA"):
        store.blocks.forget("SHA256:x")
    store.blocks.forget(anna.fingerprint)
    assert store.blocked(lock) == []


def test_a_damaged_file_of_lists_is_an_error_not_a_permission(store: Store, anna: Signer) -> None:
    lock = install(store, BOT, DIAL)
    know(store, anna, Block(WHY, "drivers/bot"))
    file = store.folder / "blocks.json"
    file.write_bytes(file.read_bytes()[:-9])
    os.utime(file, ns=(1, 1))
    with pytest.raises(PackageError, match=r"blocks\.json: this file is damaged"):
        store.document(lock)


def test_too_many_lists_are_refused(store: Store, anna: Signer) -> None:
    for number in range(64):
        know(store, anna, list_id=f"{number:032x}")
    with pytest.raises(PackageError, match="at most 64 block lists"):
        know(store, anna)


@pytest.mark.parametrize(
    "entry",
    [
        {},
        {"package": "drivers/bot", "sha256": "0" * 64},
        {"package": "bot"},
        {"package": "drivers/bot", "versions": "new"},
        {"sha256": "xyz"},
        {"key": "SHA256:x"},
        {"package": "drivers/bot", "why": ""},
        {"package": "drivers/bot", "why": "a\u202eb"},
    ],
)
def test_an_ambiguous_entry_is_no_entry(anna: Signer, entry: dict[str, str]) -> None:
    file = sign_blocks(BlockList(ID, (Block(WHY, "drivers/bot"),)), 1, IndexSigner(anna))
    said = msgspec.json.decode(file.to_bytes())
    said["listed"]["blocks"] = [{"why": WHY, **entry}]
    with pytest.raises(PackageError, match="this is not a block list"):
        read_block_file(msgspec.json.encode(said), "test")


def test_a_changed_file_does_not_match_its_signature(anna: Signer) -> None:
    file = sign_blocks(BlockList(ID, (Block(WHY, "drivers/bot"),)), 7, IndexSigner(anna))
    assert read_block_file(file.to_bytes(), "test") == file
    for old, new in ((b"bot", b"bat"), (b"7", b"8"), (b"Anna", b"Anne"), (b"wrong", b"right")):
        with pytest.raises(PackageError, match="the list does not match the signature"):
            read_block_file(file.to_bytes().replace(old, new, 1), "test")
    for data in (b"", b"{", b"x" * (5 << 20), b"\xff"):
        with pytest.raises(PackageError, match="this is not a block list"):
            read_block_file(data, "test")


class Lab:
    """A repository with a driver, and a client that asks it."""

    def __init__(self, folder: Path, signer: Signer) -> None:
        self.folder = folder / "lab"
        self.index_signer = IndexSigner(signer)
        write_package(self.folder, "widget", "dial")
        make_index(self.folder, "Lab", lambda _: [], self.index_signer)
        self.web = Web(self.folder)
        self.said: list[str] = []
        self.client = Repository(URL, folder / "data/packages/repositories", self.said.append)
        self.known = BlockStore(folder / "data/packages")

    def refreshed(self) -> list[str]:
        """Ask for the index; return the subjects of the blocks that are known then."""
        self.client.refresh()
        return [one.subject for known in self.known.all() for one in known.listed.blocks]


@pytest.fixture
def lab(tmp_path: Path, anna: Signer, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    made = Lab(tmp_path, anna)
    monkeypatch.setattr(repositories, "ask", made.web.ask)
    yield made
    assert made.said == []


def test_a_list_comes_with_the_signed_index_and_goes_with_it(lab: Lab) -> None:
    assert lab.refreshed() == []
    block(lab.folder, Block(WHY, "widgets/dial", "<2"), lab.index_signer)
    block(lab.folder, Block("It is worse.", "widgets/dial", "<2"), lab.index_signer)
    assert lab.refreshed() == ["widgets/dial <2"]
    make_index(lab.folder, "Lab", lambda _: [], lab.index_signer)
    assert lab.refreshed() == ["widgets/dial <2"]
    with pytest.raises(PackageError, match="widgets/dial is not blocked; blocked: widgets/dial <2"):
        unblock(lab.folder, "widgets/dial", lab.index_signer)
    unblock(lab.folder, "widgets/dial <2", lab.index_signer)
    assert lab.refreshed() == []


def test_a_list_outlives_its_repository(lab: Lab, tmp_path: Path) -> None:
    """Removing a repository must not unblock what it has blocked."""
    block(lab.folder, Block(WHY, "widgets/dial"), lab.index_signer)
    lab.refreshed()
    lab.client.forget()
    assert [known.place for known in lab.known.all()] == [URL]


def test_the_list_of_an_unsigned_index_is_ignored(lab: Lab) -> None:
    """Anyone on the way could have written it, to stop robots."""
    block(lab.folder, Block(WHY, "widgets/dial"), lab.index_signer)
    lab.web.instead["index/head.json"] = None
    assert lab.refreshed() == []


def test_a_list_needs_a_key_and_an_index(lab: Lab, tmp_path: Path) -> None:
    entry = Block(WHY, "widgets/dial")
    before = (lab.folder / INDEX).read_bytes()
    with pytest.raises(PackageError, match="clients accept only a signed list"):
        block(lab.folder, entry, None)
    other = IndexSigner(new_signer("Mallory", tmp_path / "mallory.pem"))
    with pytest.raises(PackageError, match="the index is signed by Anna"):
        block(lab.folder, entry, other)
    with pytest.raises(PackageError, match="this is not a repository"):
        block(tmp_path, entry, lab.index_signer)
    with pytest.raises(PackageError, match="has never blocked a package"):
        export_blocks(lab.folder, lab.index_signer)
    assert (lab.folder / INDEX).read_bytes() == before


def test_the_exported_list_has_the_number_of_the_index(lab: Lab) -> None:
    index = block(lab.folder, Block(WHY, "widgets/dial"), lab.index_signer)
    file = export_blocks(lab.folder, lab.index_signer)
    assert (file.number, file.listed) == (index.number, index.block_list)
    lab.refreshed()
    lab.known.keep(file.signature, file.number, file.listed, "file")  # the same list twice
    assert PackageId("widget", "dial") == index.packages[0].key
