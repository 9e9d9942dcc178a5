"""Repositories that lie, flood, stall or send archives that try to escape: `urc install` refuses.

Each time one line says so, and the store is the same to the last byte.
"""

import gzip
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from tests.e2e.command_line import TIMEOUT_S
from tests.e2e.package_people import Person
from tests.unit.packages.made import package
from tests.unit.packages.test_archive import HOSTILE as ARCHIVES
from urc.packages import http_repository, repositories
from urc.packages.archive import PACKAGE
from urc.packages.http_repository import ask, fetch_archive
from urc.packages.index import Index, IndexEntry, entry_of
from urc.packages.names import PackageError
from urc.packages.package import sha256

Answer = Callable[[BaseHTTPRequestHandler], None]

DIAL = package("widget", "dial")
ENTRY = entry_of(DIAL)
INDEX = Index(1, "evil", (ENTRY,)).to_bytes()
GOOD = package("widget", "good")


@pytest.fixture
def person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Person:
    """Somebody who has something installed already."""
    made = Person(tmp_path / "data", capsys, monkeypatch)
    file = tmp_path / "good.zip"
    file.write_bytes(GOOD.data)
    made.does("install", str(file), "--yes", "--allow-unsigned", "widgets/good")
    assert made.holds()
    return made


@contextmanager
def server(handler: type[BaseHTTPRequestHandler]) -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{http.server_port}/"
        finally:
            http.shutdown()
            thread.join(TIMEOUT_S)


class _Quiet(BaseHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        pass


def evil(answer: Answer, index: bytes = INDEX) -> type[BaseHTTPRequestHandler]:
    """Return a server that lists packages, and gives something else for their archives."""

    class Handler(_Quiet):
        def do_GET(self) -> None:
            if self.path == "/index/head.json":
                self.send_error(404)
            elif self.path == "/index.json":
                says(index, content_length=str(len(index)))(self)
            else:
                answer(self)

    return Handler


def says(body: bytes, status: int = 200, **headers: str) -> Answer:
    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(status)
        for name, value in headers.items():
            handler.send_header(name.replace("_", "-"), value)
        handler.end_headers()
        with suppress(OSError):  # the other side has seen enough
            handler.wfile.write(body)

    return answer


def floods(handler: BaseHTTPRequestHandler) -> None:
    """Send 10 GB of zeros, as far as anybody takes them."""
    handler.send_response(200)
    handler.send_header("content-length", str(10 << 30))
    handler.end_headers()
    zeros = bytes(1 << 20)
    try:
        for _ in range(10 << 10):
            handler.wfile.write(zeros)
    except OSError:
        return
    raise AssertionError("somebody took all of it")


def test_an_archive_that_tries_to_escape_is_refused(person: Person, tmp_path: Path) -> None:
    """Every one of them, from a live server whose index names exactly these bytes."""
    made = {name: make() for name, (make, _) in ARCHIVES.items()}
    told = {name: text for name, (_, text) in ARCHIVES.items()}
    names = {f"evil-{number}": name for number, name in enumerate(made)}
    entries = tuple(
        IndexEntry(
            "widget", word, "1.0.0", sha256(made[name]), min(len(made[name]), PACKAGE.archive_bytes)
        )
        for word, name in names.items()
    )
    outside = {file for file in tmp_path.rglob("*") if "data" not in file.parts}

    def answer(handler: BaseHTTPRequestHandler) -> None:
        says(made[names[handler.path.split("/")[3]]])(handler)

    with server(evil(answer, Index(1, "evil", entries).to_bytes())) as url:
        person.does("repo", "add", url)
        for word, name in names.items():
            began = time.process_time()
            complaint = person.refuses("install", word, "--yes", "--allow-unsigned", word)
            assert time.process_time() - began < 10, name
            is_too_large = len(made[name]) > PACKAGE.archive_bytes
            assert ("larger than the limit" if is_too_large else told[name]) in complaint, name
    assert {file for file in tmp_path.rglob("*") if "data" not in file.parts} == outside
    assert not os.path.exists("/etc/passwd.txt")


HOSTILE: dict[str, tuple[Answer, str]] = {
    "cut": (says(DIAL.data[:-1]), "the archive does not match its digest in the index"),
    "less than told": (says(b"PK", content_length=str(len(DIAL.data))), "archives/widgets/dial"),
    "other bytes": (
        says(DIAL.data[:-1] + b"\1"),
        "the archive does not match its digest in the index",
    ),
    "more": (says(DIAL.data + b"x" * 99999), "larger than the limit"),
    "10 GB of zeros": (floods, "larger than the limit"),
    "elsewhere": (
        says(b"", 302, location="http://127.0.0.1:1/"),
        "the server replied with status 302, not",
    ),
    "gone": (says(b"", 404), "the server replied with status 404, not 200"),
    "compressed": (
        says(gzip.compress(bytes(1 << 20)), content_encoding="gzip"),
        "the server compressed",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_server_that_lies_about_its_archive_is_refused(name: str, person: Person) -> None:
    """The line names the address."""
    answer, told = HOSTILE[name]
    with server(evil(answer)) as url:
        person.does("repo", "add", url)
        complaint = person.refuses("install", "dial", "--yes")
    assert told in complaint
    assert f"{url}archives/widgets/dial/1.0.0.zip" in complaint


def test_a_server_that_stalls_is_given_up(person: Person, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the midst of an archive."""
    ended = threading.Event()

    def stall(handler: BaseHTTPRequestHandler) -> None:
        says(DIAL.data[:100], content_length=str(len(DIAL.data)))(handler)
        ended.wait(TIMEOUT_S)

    def impatient(url: str, entry: IndexEntry) -> bytes:
        with monkeypatch.context() as patch:  # for the archive alone: a busy machine answers late
            patch.setattr(http_repository, "_READ_S", 0.3)
            return fetch_archive(url, entry)

    monkeypatch.setattr(repositories, "fetch_archive", impatient)
    with server(evil(stall)) as url:
        person.does("repo", "add", url)
        complaint = person.refuses("install", "dial", "--yes")
        ended.set()
    assert "the server stopped sending" in complaint
    assert f"{url}archives/widgets/dial/1.0.0.zip" in complaint


def test_a_server_that_drips_is_given_up() -> None:
    """Within the time that was given, though each byte comes in time."""
    ended = threading.Event()

    def drip(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        handler.end_headers()
        while not ended.wait(0.05):
            try:
                handler.wfile.write(b".")
            except OSError:
                return

    with server(evil(drip)) as url:
        with pytest.raises(PackageError, match="the transfer was incomplete after 1 s"):
            ask(f"{url}x", 1 << 20, total_s=1.0)
        ended.set()
    with closing(socket.create_server(("127.0.0.1", 0))) as silent:
        with pytest.raises(PackageError, match="the transfer was incomplete after 1 s"):
            ask(f"http://127.0.0.1:{silent.getsockname()[1]}/", 1 << 20, total_s=1.0)
        port = silent.getsockname()[1]
    with pytest.raises(PackageError, match=f"http://127.0.0.1:{port}/"):
        fetch_archive(f"http://127.0.0.1:{port}/", ENTRY)


@pytest.mark.parametrize(
    "index",
    [
        b"", b"[]", b"{}", b"\xff", b'{"format":2,"name":"x","packages":[]}',
        INDEX.replace(b"1.0.0", b"../x1"), INDEX.replace(b'"dial"', b'"../d"'),
        INDEX.replace(b'"widget"', b'"script"'), INDEX.replace(b'"dial"', b'"dial\\n"'),
        INDEX.replace(b"1.0.0", b"1.0.0\\n"), INDEX.replace(ENTRY.sha256.encode(), b"f"),
        INDEX.replace(b'"needs": {}', b'"needs": {"dial": "soon"}'),
        INDEX.replace(b'"needs": {}', b'"needs": {}, "signature": {"by": "x"}'),
        b"[" * 100_000,
    ],
)  # fmt: skip
def test_an_index_that_is_none_is_not_added(index: bytes, person: Person) -> None:
    """And the repository is not remembered."""
    with server(evil(says(b""), index)) as url:
        told = person.refuses("repo", "add", url)
    assert "this is not the index of a repository" in told
    assert person.does("repo", "list") == ""


def test_a_package_that_says_less_than_its_index_is_refused(person: Person) -> None:
    """The index names another version of it than it is."""
    false = entry_of(package("widget", "dial", "9.0.0"))
    entry = IndexEntry("widget", "dial", false.version, DIAL.digest, len(DIAL.data))
    with server(evil(says(DIAL.data), Index(1, "evil", (entry,)).to_bytes())) as url:
        person.does("repo", "add", url)
        told = person.refuses("install", "dial", "--yes", "--allow-unsigned", "dial")
    assert "widgets/dial 9.0.0: found widgets/dial 1.0.0" in told


@pytest.mark.parametrize(
    ("status", "body", "told"),
    [
        (302, b"", "the server replied with status 302"),
        (405, b"", "this server does not accept uploads (status 405); start one with"),
        (409, b'{"error": "listed\\n\\u001b[2J already"}', "listed\\x0a\\x1b[2J already"),
        (500, b"<html>", "the server replied with status 500"),
        (201, b"{}", "the upload was accepted, but the server's response is invalid"),
        (
            201,
            b'{"listed": "x", "sha256": "0"}',
            "the server listed an archive that differs from the uploaded archive",
        ),
        (422, b"x" * 100_000, "larger than the limit of 65536 bytes"),
    ],
)
def test_a_server_that_answers_what_is_published_with_nonsense(
    person: Person, tmp_path: Path, status: int, body: bytes, told: str
) -> None:
    """It is told in one line, and a token goes to no other place."""
    heard: list[str] = []

    class Taker(_Quiet):
        def do_PUT(self) -> None:
            self.rfile.read(int(self.headers["content-length"]))
            heard.append(self.path)
            where = {"location": f"http://127.0.0.1:{self.server.server_port}/stolen"}  # type: ignore[attr-defined]
            says(body, status, content_length=str(len(body)), **where)(self)

    (tmp_path / "token").write_text("urc_" + "x" * 43)
    (tmp_path / "dial.zip").write_bytes(DIAL.data)
    with server(Taker) as url:
        words = ["publish", str(tmp_path / "dial.zip"), "--to", url]
        complaint = person.refuses(*words, "--token-file", str(tmp_path / "token"))
    assert told in complaint
    assert heard == ["/archives/widgets/dial/1.0.0.zip"]
