"""Updates of an index: a client asks for the head first, and refuses an older index."""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from tests.unit.packages.made import entry
from urc.packages import atomic_files, repositories
from urc.packages.http_repository import HttpResponse
from urc.packages.index import INDEX, IndexEntry, read_index
from urc.packages.index_builder import write_index
from urc.packages.index_head import HEAD, read_head
from urc.packages.names import PackageError
from urc.packages.package import sha256
from urc.packages.repositories import Repository

URL = "http://lab/"


def entries(count: int) -> list[IndexEntry]:
    return [entry(f"widgets/w{number}", "1.0.0") for number in range(count)]


class Web:
    """A static web server: gives out the files of a folder, and counts."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.asked: list[str] = []
        self.sent = 0
        self.instead: dict[str, bytes | None] = {}
        """Path → what is given out instead of the file; None: nothing."""

    def ask(self, url: str, most: int, etag: str = "", *, may_lack: bool = False) -> HttpResponse:
        path = url.removeprefix(URL)
        self.asked.append(path)
        file = self.folder / path
        body = self.instead.get(path, file.read_bytes() if file.is_file() else None)
        if body is None:
            if may_lack:
                return HttpResponse(404, "", b"")
            raise PackageError(f"{url}: the server answers 404, not 200")
        tag = hashlib.md5(body).hexdigest()  # noqa: S324 (an ETag is no secret)
        if etag == tag:
            return HttpResponse(304, etag, b"")
        self.sent += len(body)
        assert len(body) <= most
        return HttpResponse(200, tag, body)


class Lab:
    """A repository's folder, its web server, and somebody who asks it."""

    def __init__(self, folder: Path, web: Web) -> None:
        self.folder = folder
        self.web = web
        self.said: list[str] = []
        self.client = Repository(URL, folder.parent / "client", self.said.append)

    def write(self, listed: list[IndexEntry], name: str = "Lab") -> int:
        return write_index(self.folder, name, listed, self.folder / ".work").number

    def asks(self) -> list[str]:
        """Ask for the index; return what that took. What is known then is what there is."""
        self.web.asked.clear()
        known = self.client.refresh()
        assert known == read_index((self.folder / INDEX).read_bytes(), INDEX)
        return list(self.web.asked)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    made = Lab(tmp_path / "lab", Web(tmp_path / "lab"))
    monkeypatch.setattr(repositories, "ask", made.web.ask)
    yield made
    assert made.said == []


def test_nothing_new_is_one_small_question(lab: Lab) -> None:
    """Answered without a byte of content."""
    assert lab.write(entries(3)) == 1
    assert lab.asks() == [HEAD, INDEX]
    sent = lab.web.sent
    assert lab.asks() == [HEAD]
    assert lab.web.sent == sent


def test_a_change_brings_the_whole_index(lab: Lab) -> None:
    """A new package, another summary, a package less, a new name."""
    lab.write(entries(3))
    lab.asks()
    assert lab.write(entries(4)) == 2
    assert lab.asks() == [HEAD, INDEX]
    changed = entries(4)
    changed[2] = msgspec.structs.replace(changed[2], summary="new")
    assert lab.write(changed) == 3
    assert lab.write(changed[1:], "Other") == 4
    assert lab.asks() == [HEAD, INDEX]
    assert lab.client.refresh().name == "Other"


def test_the_same_again_changes_nothing(lab: Lab) -> None:
    """Not a byte, whatever the order; so no client takes anything."""
    listed = entries(5)
    lab.write(listed)
    before = {file: file.read_bytes() for file in lab.folder.rglob("*.json")}
    assert lab.write(listed[::-1]) == 1
    assert {file: file.read_bytes() for file in lab.folder.rglob("*.json")} == before


@pytest.mark.parametrize("instead", [None, b"", b"{}", b"\xff"])
def test_an_index_without_a_sound_head_is_read_all_the_same(
    lab: Lab, instead: bytes | None
) -> None:
    """A static server may lack the head, or serve a damaged one."""
    lab.write(entries(3))
    lab.asks()
    lab.write(entries(4))
    lab.web.instead[HEAD] = instead
    assert lab.asks() == [HEAD, INDEX]


def test_a_repository_that_goes_back_is_not_believed(lab: Lab) -> None:
    """What it said last is used: an old index would hide the version that mends a fault."""
    lab.write(entries(2))
    old = {path: (lab.folder / path).read_bytes() for path in (INDEX, HEAD)}
    lab.write(entries(3))
    lab.asks()
    lab.web.instead |= old
    with pytest.raises(PackageError, match="the index number decreased from 2 to 1"):
        lab.client.refresh()
    lab.web.instead[HEAD] = None  # nor when it hides that
    with pytest.raises(PackageError, match="'urc repo remove http://lab/' and add the"):
        lab.client.refresh()
    assert len(lab.client.entries()) == 3
    assert "decreased" in lab.said.pop()
    lab.client.forget()
    assert len(lab.client.refresh().packages) == 2


def test_one_number_means_one_index(lab: Lab) -> None:
    """Another one under the same number is refused, too."""
    lab.write(entries(2))
    lab.asks()
    false = msgspec.structs.replace(lab.client.refresh(), packages=tuple(entries(1))).to_bytes()
    head = msgspec.json.encode(
        msgspec.structs.replace(
            read_head((lab.folder / HEAD).read_bytes(), ""), sha256=sha256(false)
        )
    )
    lab.web.instead |= {INDEX: false, HEAD: head}
    with pytest.raises(PackageError, match="or the index changed without a new number"):
        lab.client.refresh()


@pytest.mark.parametrize("harm", [b"", b"{", b"\xff\xff"])
def test_a_damaged_index_is_made_anew_with_a_higher_number(lab: Lab, harm: bytes) -> None:
    """No client has seen that one, so each takes it."""
    for count in (1, 2, 3):
        lab.write(entries(count))
    lab.asks()
    (lab.folder / INDEX).write_bytes(harm)
    assert lab.write(entries(3)) == 4
    lab.asks()


def test_what_a_client_kept_may_be_damaged(lab: Lab) -> None:
    """Then it asks for all of it."""
    lab.write(entries(2))
    lab.asks()
    (kept,) = (lab.folder.parent / "client").glob("*.index.json")
    kept.write_bytes(b"{")
    assert lab.asks() == [HEAD, INDEX]
    assert "the index will be downloaded again" in lab.said.pop()


def test_a_keeper_killed_at_any_moment_leaves_a_repository_to_read(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clients get the index before or after, and the next one that is written mends the rest."""
    lab.write(entries(1))
    lab.asks()
    real: Callable[..., Any] = atomic_files.put_file
    for files in range(3):
        lab.write(entries(files + 1))
        lab.asks()
        left = [files]

        def put(*words: Any, left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
            real(*words)

        with monkeypatch.context() as patch:
            patch.setattr(atomic_files, "put_file", put)
            if files < 2:
                with pytest.raises(KeyboardInterrupt):
                    lab.write(entries(files + 2))
            else:
                lab.write(entries(files + 2))
        lab.client.refresh()
        lab.write(entries(files + 2))
        lab.asks()
