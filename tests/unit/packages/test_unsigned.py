"""Packages without a signature: refused, unless the user waives the signature by name."""

from pathlib import Path

import pytest

from tests.unit.packages.made import assert_whole, install, package
from tests.unit.packages.test_signature import sign
from urc.packages.install import plan_file
from urc.packages.install_plan import InstallPlan
from urc.packages.names import PackageError, PackageId
from urc.packages.package import Package
from urc.packages.signature import new_signer
from urc.packages.sources import FileSource
from urc.packages.store import Store

DIAL = package("widget", "dial", "1.0.0")
DIAL_2 = package("widget", "dial", "1.1.0")
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "*"})
KEY = PackageId("widget", "dial")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "packages")


def plan_of(store: Store, *packages: Package, is_folder: bool = False) -> InstallPlan:
    source = FileSource("test", packages, [packages[0].manifest.key], is_folder=is_folder)
    return plan_file(source, (), store, print)


def test_an_unsigned_package_is_refused_in_one_line(store: Store) -> None:
    """The line names every unsigned package and the waiver."""
    with pytest.raises(PackageError) as refused:
        install(store, BOT, DIAL, waives=False)
    told = str(refused.value)
    assert "drivers/bot 1.0.0 and widgets/dial 1.0.0 are not signed" in told
    assert "--allow-unsigned drivers/bot --allow-unsigned widgets/dial" in told
    assert "\n" not in told
    assert assert_whole(store) == []


def test_a_waiver_covers_only_the_named_package(store: Store) -> None:
    plan = plan_of(store, BOT, DIAL)._replace(waived=frozenset({"drivers/bot"}))
    with (
        pytest.raises(PackageError, match=r"^widgets/dial 1.0.0 is not signed"),
        store.changing() as change,
    ):
        change.stage(plan)
    with store.changing() as change:
        change.stage(plan._replace(waived=frozenset({"drivers/bot", "widgets/dial"})))


def test_a_signed_dependency_of_an_unsigned_package_needs_no_waiver(
    store: Store, tmp_path: Path
) -> None:
    signer = new_signer("Anna", tmp_path / "anna.pem")
    source = FileSource("test", [BOT, DIAL], [BOT.manifest.key], sign(signer, DIAL))
    plan = plan_file(source, (), store, print)
    assert store.state().lacking(plan) == ["drivers/bot"]


def test_a_stored_waiver_holds_for_all_versions_until_it_ends(store: Store) -> None:
    with store.changing() as change:
        change.waive(KEY)
        change.waive(KEY)
    assert store.state().waived == ("widgets/dial",)
    install(store, DIAL, waives=False)
    install(store, DIAL_2, waives=False)
    with store.changing() as change:
        change.end_waiver(KEY)
    assert store.state().lacking(plan_of(store, package("widget", "dial", "1.2.0")))
    with (
        pytest.raises(PackageError, match="widgets/dial has no waiver; waivers exist for: none"),
        store.changing() as change,
    ):
        change.end_waiver(KEY)


def test_no_waiver_replaces_the_signature_of_a_pinned_key(store: Store, tmp_path: Path) -> None:
    """Otherwise an attacker would only have to remove the signature of an update."""
    install(store, DIAL, signatures=sign(new_signer("Anna", tmp_path / "anna.pem"), DIAL))
    with store.changing() as change:
        change.waive(KEY)
    with pytest.raises(PackageError, match="is not signed, but the key SHA256:"):
        install(store, DIAL_2)


def test_bytes_that_are_already_in_use_need_no_second_waiver(store: Store) -> None:
    """The user has accepted these bytes; another version needs a new waiver."""
    install(store, DIAL)
    assert store.state().lacking(plan_of(store, BOT, DIAL)) == ["drivers/bot"]
    assert store.state().lacking(plan_of(store, BOT, DIAL_2)) == ["drivers/bot", "widgets/dial"]


def test_a_folder_of_ones_own_needs_no_signature(store: Store) -> None:
    """A repository's dependencies of this folder do."""
    folder = FileSource("folder", [BOT], [BOT.manifest.key], is_folder=True)
    plan = plan_file(folder, [FileSource("lab", [DIAL], [KEY])], store, print)
    assert store.state().lacking(plan) == ["widgets/dial"]
    install(store, DIAL, is_folder=True, waives=False)
