"""Who made a package: what a signature covers, whose key is kept, and what is refused."""

import stat
from pathlib import Path

import msgspec
import pytest

from tests.unit.packages.made import assert_whole, install, package
from urc.packages.install import plan_file
from urc.packages.names import PackageError, PackageId, parse_requirement
from urc.packages.package import Package
from urc.packages.signature import Signature, Signer, new_signer, read_signer
from urc.packages.sources import FileSource
from urc.packages.store import Store

DIAL = package("widget", "dial", "1.0.0")
DIAL_2 = package("widget", "dial", "1.1.0")
PACKAGE = PackageId("widget", "dial")


@pytest.fixture
def anna(tmp_path: Path) -> Signer:
    return new_signer("Anna", tmp_path / "anna.pem")


@pytest.fixture
def mallory(tmp_path: Path) -> Signer:
    return new_signer("Anna", tmp_path / "mallory.pem")  # anybody can go by any name


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "packages")


def sign(signer: Signer, made: Package) -> dict[str, Signature]:
    said = made.manifest
    return {made.digest: signer.sign(said.key, said.version, made.digest)}


def test_a_signature_is_of_one_package_one_version_and_its_bytes(anna: Signer) -> None:
    """Whatever else it is shown with, it does not hold."""
    signature = anna.sign(PACKAGE, "1.0.0", DIAL.digest)
    signature.check(PACKAGE, "1.0.0", DIAL.digest)
    assert signature == anna.sign(PACKAGE, "1.0.0", DIAL.digest)
    for said in (
        (PackageId("driver", "dial"), "1.0.0", DIAL.digest),
        (PackageId("widget", "dia"), "1.0.0", DIAL.digest),
        (PACKAGE, "1.0.1", DIAL.digest),
        (PACKAGE, "1.0.0", DIAL_2.digest),
    ):
        with pytest.raises(PackageError, match="the signature does not match the archive"):
            signature.check(*said)


def test_a_signature_with_another_name_or_key_does_not_hold(anna: Signer, mallory: Signer) -> None:
    """A repository cannot rename who made something, nor put another key beside it."""
    signature = anna.sign(PACKAGE, "1.0.0", DIAL.digest)
    for changed in (
        msgspec.structs.replace(signature, by="Anne"),
        msgspec.structs.replace(signature, key=mallory.key),
        msgspec.structs.replace(signature, value="A" * 86 + "=="),
    ):
        with pytest.raises(PackageError, match="the signature does not match the archive"):
            changed.check(PACKAGE, "1.0.0", DIAL.digest)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"by":"Anna"', '"by":""'),
        ('"by":"Anna"', '"by":"An\\u202ena"'),
        ('"by":"Anna"', '"by":"An\\nna"'),
        ('"key":"', '"key":"*'),
        ('=","value"', 'B","value"'),
        ('=="}', '="}'),
    ],
)
def test_what_is_no_signature_is_not_read(anna: Signer, old: str, new: str) -> None:
    """Nor one that people would read as something else."""
    text = msgspec.json.encode(anna.sign(PACKAGE, "1.0.0", DIAL.digest)).decode()
    assert old in text
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(text.replace(old, new, 1), type=Signature)


def test_base64_with_a_second_spelling_is_refused(anna: Signer) -> None:
    """Else one key could be shown in two ways, and the second taken for another."""
    signature = anna.sign(PACKAGE, "1.0.0", DIAL.digest)
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    last = letters[letters.index(signature.key[42]) ^ 1]
    with pytest.raises(ValueError, match="without extra bits"):
        msgspec.structs.replace(signature, key=signature.key[:42] + last + "=").__post_init__()


def test_a_key_is_kept_for_its_owner_alone_and_never_overwritten(tmp_path: Path) -> None:
    """With the name, and readable by any program that knows PKCS #8."""
    file = tmp_path / "deep" / "key.pem"
    assert read_signer(file) is None
    made = new_signer("Jörg & Co.", file)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    again = read_signer(file)
    assert again is not None
    assert (again.by, again.key) == ("Jörg & Co.", made.key)
    assert made.fingerprint.startswith("SHA256:")
    with pytest.raises(PackageError, match="this key already exists"):
        new_signer("x", file)
    for text in ("", "x", file.read_text("utf-8").replace("Publisher", "Someone"), "Publisher: \n"):
        file.write_text(text, "utf-8")
        with pytest.raises(PackageError, match="this is not a publisher's key"):
            read_signer(file)
    with pytest.raises(PackageError, match="expected a publisher's name"):
        new_signer("two\nlines", tmp_path / "other.pem")


def test_the_key_of_the_first_install_is_kept(store: Store, anna: Signer) -> None:
    """And a later version with it is taken without a word."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    assert store.state().keys == {"widgets/dial": anna.key}
    install(store, DIAL_2, signatures=sign(anna, DIAL_2))
    assert assert_whole(store) == ["widgets/dial 1.0.0", "widgets/dial 1.1.0"]
    kept = store.signature(DIAL.digest)
    assert kept is not None
    assert str(kept) == str(anna)


def test_another_key_is_refused_in_one_line(store: Store, anna: Signer, mallory: Signer) -> None:
    """With both fingerprints and what to do; also after the package was removed."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    with store.changing() as change:
        change.remove(parse_requirement("dial"))
    with pytest.raises(PackageError) as refused:
        install(store, DIAL_2, signatures=sign(mallory, DIAL_2))
    told = str(refused.value)
    assert mallory.fingerprint in told
    assert anna.fingerprint in told
    assert "run 'urc repo key forget widgets/dial'" in told
    assert "\n" not in told
    assert assert_whole(store) == []
    with store.changing() as change:
        change.forget_key(PACKAGE)
    install(store, DIAL_2, signatures=sign(mallory, DIAL_2))
    assert store.state().keys == {"widgets/dial": mallory.key}


def test_a_signature_cannot_just_be_left_out(store: Store, anna: Signer) -> None:
    """Else nobody would have to forge one."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    with pytest.raises(PackageError, match="is not signed, but the key SHA256:"):
        install(store, DIAL_2)
    assert assert_whole(store) == ["widgets/dial 1.0.0"]


def test_a_signature_that_is_none_is_refused_at_once(store: Store, anna: Signer) -> None:
    """Nothing is installed, and no key is kept."""
    false = {DIAL.digest: anna.sign(PACKAGE, "1.0.0", DIAL_2.digest)}
    with pytest.raises(PackageError, match="the signature does not match the archive"):
        install(store, DIAL, signatures=false)
    assert store.state().keys == {}
    assert assert_whole(store) == []


def test_ones_own_folder_is_taken_as_it_is(store: Store, anna: Signer) -> None:
    """To try a change, before it is signed; the key that was kept stays."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    install(store, DIAL_2, is_folder=True)
    assert assert_whole(store) == ["widgets/dial 1.0.0", "widgets/dial 1.1.0"]
    assert store.state().keys == {"widgets/dial": anna.key}


def test_what_comes_along_with_ones_own_folder_is_held_to_its_key(
    store: Store, anna: Signer, mallory: Signer
) -> None:
    """Only the folder is one's own, not what a repository adds to it."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    bot = package("driver", "bot", "1.0.0", {"widgets/dial": "^1.1"})
    folder = FileSource("folder", [bot], [bot.manifest.key], is_folder=True)
    false = FileSource("lab", [DIAL_2], [PACKAGE], sign(mallory, DIAL_2))
    plan = plan_file(folder, [false], store, print)
    assert plan.own == {"drivers/bot"}
    with (
        pytest.raises(PackageError, match="is signed by another key"),
        store.changing() as change,
    ):
        change.stage(plan)


def test_what_was_not_signed_may_become_so(store: Store, anna: Signer) -> None:
    """From then on it must be."""
    install(store, DIAL)
    assert store.state().keys == {}
    install(store, DIAL_2, signatures=sign(anna, DIAL_2))
    assert store.state().keys == {"widgets/dial": anna.key}


def test_forgetting_what_is_not_kept_is_told(store: Store, anna: Signer) -> None:
    """With what there is."""
    install(store, DIAL, signatures=sign(anna, DIAL))
    with (
        pytest.raises(PackageError, match="keys are pinned for: widgets/dial"),
        store.changing() as change,
    ):
        change.forget_key(PackageId("driver", "dial"))
