"""An index that its keeper signs: for some days, with a key that is kept on first use."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import entry, write_package
from tests.unit.packages.test_index_updates import URL, Web, entries
from urc.packages import repositories
from urc.packages.index import INDEX
from urc.packages.index_builder import make_index, renew, withdraw, write_index
from urc.packages.index_head import HEAD, VALID_S, IndexHead, IndexSigner, read_head
from urc.packages.names import PackageError, PackageId
from urc.packages.repositories import Repository
from urc.packages.server import repository_app
from urc.packages.signature import Signer, new_signer

DAY_S = 86400.0


class Signed:
    """A repository whose keeper has a key, a clock, and somebody who asks it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "lab"
        self.web = Web(self.folder)
        self.now = 1_800_000_000.0
        self.said: list[str] = []
        self.key = new_signer("Keeper", folder / "keeper.pem")
        self.other = new_signer("Mallory", folder / "other.pem")
        self.client = Repository(URL, folder / "client", self.said.append, lambda: self.now)

    def write(self, count: int, signer: Signer | None = None) -> None:
        """List some packages, signed with the keeper's key or another one."""
        index_signer = IndexSigner(signer or self.key, VALID_S, lambda: self.now)
        write_index(self.folder, "Lab", entries(count), self.folder / ".work", index_signer)

    def head(self) -> IndexHead:
        return read_head((self.folder / HEAD).read_bytes(), HEAD)

    def refuses(self, told: str) -> None:
        """Ask for the index, which must not be believed."""
        with pytest.raises(PackageError, match=told) as refused:
            self.client.refresh()
        assert "\n" not in str(refused.value)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Signed]:
    made = Signed(tmp_path)
    monkeypatch.setattr(repositories, "ask", made.web.ask)
    yield made
    assert made.said == []


def test_the_first_key_is_kept_and_no_other_is_believed(lab: Signed) -> None:
    """Nor an index without any; what it said last is used, until somebody forgets the key."""
    lab.write(2)
    lab.client.refresh()
    assert lab.client.keeper == str(lab.key)
    unsigned = IndexHead(1, 2, "0" * 64).to_bytes()
    (lab.folder / HEAD).unlink()
    lab.write(3, lab.other)
    for instead in (None, (lab.folder / HEAD).read_bytes(), unsigned, b"{"):
        lab.web.instead[HEAD] = instead
        lab.refuses("but the key SHA256:.* is pinned. If the maintainer confirms this")
        assert len(lab.client.entries()) == 2
        assert "its last stored index is used" in lab.said.pop()
    lab.web.instead.clear()
    lab.client.forget()
    assert len(lab.client.refresh().packages) == 3
    assert lab.client.keeper == str(lab.other)


def test_an_index_expires_and_its_renewal_is_one_small_answer(lab: Signed) -> None:
    """An old one is not used either where the repository is not reached; its end is told."""
    lab.write(2)
    lab.client.refresh()
    lab.now += VALID_S + 1
    lab.refuses("expired at 2027-01-29T.*installed packages still work")
    lab.web.instead[HEAD] = None
    with pytest.raises(PackageError, match="the index expired at"):
        lab.client.entries()
    lab.web.instead.clear()
    lab.write(2)
    lab.web.asked.clear()
    assert len(lab.client.refresh().packages) == 2
    assert lab.web.asked == [HEAD]


def test_a_head_is_signed_anew_when_half_of_its_time_is_over(lab: Signed) -> None:
    """Not before: the same packages give the same files."""
    lab.write(2)
    first = lab.head()
    lab.now += VALID_S / 2 - 60
    lab.write(2)
    assert lab.head() == first
    lab.now += 120
    renew(lab.folder, IndexSigner(lab.key, VALID_S, lambda: lab.now))
    assert lab.head().number == first.number
    assert lab.head().left_s(lab.now) == VALID_S


def test_nobody_goes_back_even_where_what_was_said_is_lost(lab: Signed) -> None:
    """The highest number is kept with the key."""
    lab.write(1)
    old = {path: (lab.folder / path).read_bytes() for path in (INDEX, HEAD)}
    lab.write(2)
    lab.client.refresh()
    for file in (lab.folder.parent / "client").glob("*.index.json"):
        file.unlink()
    lab.web.instead |= old
    lab.refuses("the index number decreased from 2 to 1")


def test_what_was_changed_on_the_way_is_not_believed(lab: Signed) -> None:
    """Neither another index under a signed head, nor a head with another time."""
    lab.write(1)
    false = (lab.folder / INDEX).read_bytes().replace(b"widgets", b"gadgets").replace(b"w0", b"x0")
    lab.web.instead[INDEX] = false
    lab.refuses("the index does not match its digest in index/head.json")
    assert lab.client.keeper == ""
    longer = msgspec.structs.replace(lab.head(), expires="2099-01-01T00:00:00Z")
    lab.web.instead |= {HEAD: longer.to_bytes()}
    lab.refuses("the index does not match the signature by Keeper")


@pytest.mark.parametrize("signs", [False, True])
def test_who_has_not_the_key_changes_no_signed_index(lab: Signed, signs: bool) -> None:
    """Clients would not believe it; nothing is written."""
    lab.write(1)
    before = {file: file.read_bytes() for file in lab.folder.rglob("*.json")}
    index_signer = IndexSigner(lab.other, VALID_S, lambda: lab.now) if signs else None
    with pytest.raises(PackageError, match=r"the index is signed by Keeper .*: select that key"):
        write_index(lab.folder, "Lab", entries(2), lab.folder / ".work", index_signer)
    assert {file: file.read_bytes() for file in lab.folder.rglob("*.json")} == before
    write_index(lab.folder, "Lab", entries(1), lab.folder / ".work")  # the same: nothing to sign
    assert {file: file.read_bytes() for file in lab.folder.rglob("*.json")} == before


@pytest.mark.parametrize(
    "head",
    [
        b'{"format":1,"number":1,"sha256":"HASH","expires":"2027-01-29T00:00:00Z"}',
        b'{"format":1,"number":1,"sha256":"HASH","expires":"tomorrow"}',
        b'{"format":1,"number":1,"sha256":"short"}',
    ],
)
def test_a_head_that_says_nonsense_is_none(head: bytes) -> None:
    """A time that nobody answers for, or that is none."""
    with pytest.raises(PackageError, match="this is not the head of an index"):
        read_head(head.replace(b"HASH", b"0" * 64), HEAD)


def test_a_server_gives_out_the_signed_head(lab: Signed) -> None:
    """Also of a version that is withdrawn: signed anew, and still there for who has a lock."""
    write_package(lab.folder, "widget", "dial")
    index_signer = IndexSigner(lab.key, VALID_S, lambda: lab.now)
    listed = make_index(lab.folder, "Lab", lambda document: [], index_signer).listed
    client = TestClient(repository_app(lab.folder))
    assert client.get(f"/{HEAD}").content == (lab.folder / HEAD).read_bytes()
    assert lab.head().signed
    (dial,) = listed.packages
    with pytest.raises(PackageError, match="the index is signed by Keeper"):
        withdraw(lab.folder, dial.key, "1.0.0", "It sticks.", None)
    assert make_index(lab.folder, "Lab", lambda document: [], index_signer).listed == listed
    withdraw(lab.folder, dial.key, "1.0.0", "It sticks.", index_signer)
    assert client.get(f"/{HEAD}").content == (lab.folder / HEAD).read_bytes()
    assert lab.head().number == 2
    assert client.get("/widgets").json() == []
    assert client.get(f"/{dial.file}").status_code == 200
    (again,) = make_index(lab.folder, "Lab", lambda document: [], index_signer).listed.packages
    assert again.why_withdrawn == "It sticks."
    with pytest.raises(PackageError, match=r"widgets/dial 2.0.0 is not listed; .* 1.0.0"):
        withdraw(lab.folder, PackageId("widget", "dial"), "2.0.0", "", index_signer)
    assert withdraw(lab.folder, dial.key, "1.0.0", "", index_signer) == dial
    assert client.get("/widgets").json() == ["/widgets/dial/"]


def test_the_statement_says_all_that_matters(lab: Signed) -> None:
    """A signature of another number, digest, time or name is none."""
    lab.write(1)
    head = lab.head()
    assert head.is_sound()
    assert head.signed is not None
    renamed = msgspec.structs.replace(head.signed, by="Keepers")
    for changed in (
        {"number": 2}, {"sha256": "0" * 64}, {"expires": "2030-01-01T00:00:00Z"},
        {"signature": renamed},
    ):  # fmt: skip
        assert not msgspec.structs.replace(head, **changed).is_sound()
    assert entry("widgets/w0", "1.0.0") == entries(1)[0]
