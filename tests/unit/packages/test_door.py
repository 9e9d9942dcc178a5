"""What a repository takes from strangers: who may, what is looked at, what is refused, and how."""

import base64
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import package, write_package
from tests.unit.packages.test_archive import HOSTILE, hostile
from urc.packages import atomic_files, server
from urc.packages.archive import PACKAGE
from urc.packages.index import INDEX, read_index
from urc.packages.index_builder import make_index
from urc.packages.names import PackageError, PackageId
from urc.packages.package import Package
from urc.packages.server import repository_app
from urc.packages.signature import SIGNATURE, Signature, Signer, new_signer
from urc.packages.tokens import UploadTokens, read_token

DIAL = package("widget", "dial")
DIAL_2 = package("widget", "dial", "1.1.0")
BOT = package("driver", "bot", "1.0.0", {"widgets/dial": "^1"})


def fine(document: Path) -> list[str]:
    """Find nothing wrong, but see to it that all that is needed stands beside a document."""
    assert document.is_file()
    return []


class Lab:
    """A repository, its keeper's tokens, and somebody who publishes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "lab"
        self.folder.mkdir()
        make_index(self.folder, "Lab", fine)
        self.tokens = UploadTokens(folder / "tokens.json")
        self.token = self.tokens.add("ci", ("widgets/*", "drivers/bot*"))
        self.examine: Callable[[Path], list[str]] = fine
        app = repository_app(self.folder, self.tokens, lambda document: self.examine(document))
        self.client = TestClient(app, raise_server_exceptions=True)

    def puts(
        self,
        made: Package,
        signature: Signature | None = None,
        *,
        token: str = "",
        file: str = "",
        data: bytes | None = None,
    ) -> tuple[int, str]:
        """Publish; return the status, and what is said."""
        headers = {"authorization": f"Bearer {token or self.token}"}
        if signature is not None:
            headers[SIGNATURE] = base64.b64encode(msgspec.json.encode(signature)).decode()
        said = made.manifest
        file = file or f"archives/{said.key}/{said.version}.zip"
        answer = self.client.put(file, content=made.data if data is None else data, headers=headers)
        return answer.status_code, " ".join(map(str, answer.json().values()))

    def holds(self) -> dict[str, bytes]:
        return {
            file.relative_to(self.folder).as_posix(): file.read_bytes()
            for file in self.folder.rglob("*")
            if file.is_file() and file.name != ".changing"
        }

    def lists(self) -> list[str]:
        index = read_index((self.folder / INDEX).read_bytes(), INDEX)
        served = self.client.get(INDEX).content
        assert read_index(served, INDEX) == index
        for entry in index.packages:
            assert self.client.get(entry.file).status_code == 200
        return [str(entry) for entry in index.packages]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    made = Lab(tmp_path)
    with made.client:
        yield made


@pytest.fixture
def anna(tmp_path: Path) -> Signer:
    return new_signer("Anna", tmp_path / "anna.pem")


def test_what_is_published_is_listed_at_once(lab: Lab) -> None:
    """And again is no fault: who did not hear the answer sends it once more."""
    assert lab.puts(DIAL) == (201, f"widgets/dial 1.0.0 {DIAL.digest}")
    before = lab.holds()
    assert lab.puts(DIAL)[0] == 200
    assert lab.holds() == before
    assert lab.puts(BOT)[0] == 201
    assert lab.lists() == ["drivers/bot 1.0.0", "widgets/dial 1.0.0"]
    (_, dial) = read_index(lab.client.get(INDEX).content, "").packages
    assert "immutable" in lab.client.get(dial.file).headers["cache-control"]
    assert lab.client.get(INDEX).headers["cache-control"] == "no-cache"


def test_other_bytes_of_a_version_are_refused(lab: Lab) -> None:
    """What somebody has installed stays what it was."""
    lab.puts(DIAL)
    before = lab.holds()
    status, told = lab.puts(package("widget", "dial", notes="more"))
    assert status == 409
    assert told == (
        "widgets/dial 1.0.0 is already listed with different content;"
        " a changed package needs a new version"
    )
    assert lab.holds() == before


@pytest.mark.parametrize("token", ["urc_" + "x" * 43, "nonsense", "ü"])
def test_a_token_that_is_none_is_refused(lab: Lab, token: str) -> None:
    """With the way that HTTP has to say so."""
    headers = {"authorization": f"Bearer {token}".encode()}
    answer = lab.client.put("archives/widgets/dial/1.0.0.zip", content=DIAL.data, headers=headers)
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"] == "Bearer"
    assert lab.client.put("archives/widgets/dial/1.0.0.zip", content=b"").status_code == 401
    assert lab.lists() == []


def test_a_token_may_only_what_it_may(lab: Lab) -> None:
    """And nothing any more once it was removed, without a restart."""
    status, told = lab.puts(package("driver", "car"))
    assert status == 403
    assert told == "the token 'ci' may publish only widgets/*, drivers/bot*, not drivers/car"
    lab.tokens.remove("ci")
    assert lab.puts(DIAL)[0] == 401


@pytest.mark.parametrize(
    "file",
    ["index.json", "archives/widgets/../dial/1.0.0.zip", "archives/widgets/dial/..%2f1.zip",
     "archives/tokens/dial/1.0.0.zip", "archives/widgets/Dial/1.0.0.zip", ".work/x.zip"],
)  # fmt: skip
def test_nothing_but_archives_can_be_put(lab: Lab, file: str) -> None:
    """Whoever asks."""
    before = lab.holds()
    assert lab.puts(DIAL, file=file)[0] in (400, 404)
    assert lab.holds() == before


def test_a_package_stands_where_it_belongs(lab: Lab) -> None:
    """Not under another version, nor another name that its token may publish."""
    status, told = lab.puts(DIAL, file="archives/widgets/dial/2.0.0.zip")
    assert (status, "expected widgets/dial 1.0.0 at archives/widgets/dial/1.0.0.zip" in told) == (
        422,
        True,
    )
    status, told = lab.puts(DIAL, file="archives/drivers/bot/1.0.0.zip")
    assert (status, "expected widgets/dial 1.0.0 at archives/widgets/dial/1.0.0.zip" in told) == (
        422,
        True,
    )
    assert lab.lists() == []


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_archive_is_refused_and_nothing_is_written(lab: Lab, name: str) -> None:
    """The same as where one is installed."""
    before = lab.holds()
    data, told = hostile(name)
    status, said = lab.puts(DIAL, data=data)
    assert status in (413, 422)
    assert status == 413 or told in said
    assert lab.holds() == before


def test_too_much_is_not_even_kept(lab: Lab) -> None:
    """Endless data ends where the largest archive would."""

    def endless() -> Iterator[bytes]:
        for _ in range(PACKAGE.archive_bytes // 65536 + 2):
            yield bytes(65536)

    headers = {"authorization": f"Bearer {lab.token}"}
    answer = lab.client.put("archives/widgets/dial/1.0.0.zip", content=endless(), headers=headers)
    assert answer.status_code == 413
    assert lab.lists() == []


def test_what_was_changed_on_the_way_is_told(lab: Lab) -> None:
    """By the digest that the sender gives along."""
    headers = {"authorization": f"Bearer {lab.token}", "urc-sha256": DIAL.digest}
    answer = lab.client.put(
        "archives/widgets/dial/1.0.0.zip", content=DIAL.data[:-1], headers=headers
    )
    assert (answer.status_code, answer.json()["error"]) == (
        400, "the upload was damaged in transit; try again",
    )  # fmt: skip


def test_a_package_that_fails_its_own_tests_is_not_listed(lab: Lab) -> None:
    """The reason names its file, and no folder of the server."""
    lab.puts(DIAL)
    lab.examine = lambda document: [f"{document}:3: a test failed"]
    before = lab.holds()
    assert lab.puts(BOT) == (422, "drivers/bot/driver.yaml:3: a test failed")
    assert lab.holds() == before


def test_what_a_package_needs_must_be_there(lab: Lab) -> None:
    """And stands beside it when it is looked at."""
    status, told = lab.puts(BOT)
    assert (status, told) == (
        422, "widgets/dial: drivers/bot 1.0.0 needs ^1; there is none",
    )  # fmt: skip
    lab.puts(DIAL)
    seen: list[str] = []

    def examine(document: Path) -> list[str]:
        top = document.parents[2]
        seen.extend(str(file.relative_to(top)) for file in sorted(top.rglob("*.yaml")))
        return []

    lab.examine = examine
    assert lab.puts(BOT)[0] == 201
    assert seen == [
        "drivers/bot/driver.yaml", "drivers/bot/package.yaml",
        "widgets/dial/package.yaml", "widgets/dial/widget.yaml",
    ]  # fmt: skip


def test_a_widget_of_urcs_own_name_is_refused(lab: Lab) -> None:
    """Nobody could install it."""
    status, told = lab.puts(package("widget", "stop"))
    assert (status, "URC's built-in widget 'stop'" in told) == (422, True)


def test_a_signature_is_checked_and_listed(lab: Lab, anna: Signer) -> None:
    """And cannot be changed for another; one can be added to what has none."""
    signature = anna.sign(PackageId("widget", "dial"), "1.0.0", DIAL.digest)
    wrong = anna.sign(PackageId("widget", "dial"), "1.0.0", DIAL_2.digest)
    assert lab.puts(DIAL, wrong)[0] == 422
    assert lab.puts(DIAL)[0] == 201
    assert lab.puts(DIAL, signature)[0] == 201
    assert lab.puts(DIAL, signature)[0] == 200
    assert lab.puts(DIAL)[0] == 200
    (entry,) = read_index(lab.client.get(INDEX).content, "").packages
    assert entry.signed == signature
    anna.by = "Somebody else"
    status, told = lab.puts(DIAL, anna.sign(PackageId("widget", "dial"), "1.0.0", DIAL.digest))
    assert status == 409
    assert told.startswith("widgets/dial 1.0.0 is already listed, signed by Anna (SHA256:")
    make_index(lab.folder, "Lab", fine)  # the keeper lists anew: nothing is lost
    assert read_index(lab.client.get(INDEX).content, "").packages == (entry,)


@pytest.mark.parametrize("text", ["%", "e30=", base64.b64encode(b"x" * 4000).decode()])
def test_a_header_that_is_no_signature_is_told(lab: Lab, text: str) -> None:
    """Not taken for none."""
    headers = {"authorization": f"Bearer {lab.token}", SIGNATURE: text}
    answer = lab.client.put("archives/widgets/dial/1.0.0.zip", content=DIAL.data, headers=headers)
    assert (answer.status_code, answer.json()) == (
        400, {"error": "the header urc-signature contains no signature"},
    )  # fmt: skip


def test_no_more_wait_than_can_be_looked_at(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """While one is being looked at, the others wait; one too many is told to come again."""
    monkeypatch.setattr(server, "_WAITING_MOST", 1)
    started, go_on = threading.Event(), threading.Event()

    def slow(document: Path) -> list[str]:
        started.set()
        assert go_on.wait(20)
        return []

    lab.examine = slow
    first: list[tuple[int, str]] = []
    thread = threading.Thread(target=lambda: first.append(lab.puts(DIAL)))
    thread.start()
    assert started.wait(20)
    assert lab.puts(DIAL_2)[0] == 503
    go_on.set()
    thread.join(20)
    assert first[0][0] == 201
    assert lab.puts(DIAL_2)[0] == 201


def test_a_server_that_ends_at_any_moment_leaves_the_repository_whole(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At every file that is written; what was cut off can be published again."""
    real: Callable[..., Any] = atomic_files.put_file
    lab.puts(DIAL)
    signer = new_signer("Anna", lab.folder.parent / "key.pem")
    deaths = 0
    for minor in range(1, 20):
        made = package("widget", "dial", f"1.{minor}.0")
        signature = signer.sign(made.manifest.key, made.manifest.version, made.digest)
        left = [minor - 1]

        def put(*words: Any, left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise OSError(28, "No space left on device")
            real(*words)

        before = lab.lists()
        with monkeypatch.context() as patch:
            patch.setattr(atomic_files, "put_file", put)
            status, told = lab.puts(made, signature)
        if status == 201:
            break
        deaths += 1
        assert (status, told) == (507, "the package cannot be stored: No space left on device")
        assert lab.lists() in (before, [*before, f"widgets/dial 1.{minor}.0"])
        assert lab.puts(made, signature)[0] in (200, 201)
        assert f"widgets/dial 1.{minor}.0" in lab.lists()
    assert deaths == 4
    assert len(make_index(lab.folder, "Lab", fine).listed.packages) == deaths + 2


def test_what_the_keeper_writes_lives_beside_what_is_published(lab: Lab) -> None:
    """One index for both."""
    lab.puts(DIAL)
    write_package(lab.folder, "interface", "plain")
    assert make_index(lab.folder, "Lab", fine).faults == ()
    lab.puts(BOT)
    assert lab.lists() == ["drivers/bot 1.0.0", "interfaces/plain 1.0.0", "widgets/dial 1.0.0"]


def test_tokens_are_shown_once_and_kept_as_digests(tmp_path: Path) -> None:
    """Each has a name, and what it may do."""
    tokens = UploadTokens(tmp_path / "tokens.json")
    assert tokens.all() == ()
    text = tokens.add("ci", ("drivers/puppet*", "widgets/dial"))
    assert text not in tokens.file.read_text()
    (tmp_path / "token").write_text(text + "\n")
    assert read_token(tmp_path / "token") == text
    found = tokens.find(text)
    assert found is not None
    may = {str(key): found.allows(key) for key in (
        PackageId("driver", "puppet"), PackageId("driver", "puppet-2"), PackageId("driver", "pup"),
        PackageId("widget", "dial"), PackageId("widget", "dial-2"), PackageId("robot", "puppet"),
    )}  # fmt: skip
    assert [name for name, is_allowed in may.items() if is_allowed] == [
        "drivers/puppet", "drivers/puppet-2", "widgets/dial",
    ]  # fmt: skip
    assert tokens.find(text[:-1]) is None
    with pytest.raises(PackageError, match="a token named 'ci' already exists"):
        tokens.add("ci", ("*",))
    with pytest.raises(PackageError, match="unknown token 'x'; expected one of: ci"):
        tokens.remove("x")


@pytest.mark.parametrize("may", ["", "drivers", "../x", "drivers/*x", "Drivers/*", "scripts/*"])
def test_what_a_token_may_is_checked(tmp_path: Path, may: str) -> None:
    """A pattern that means nothing would be a surprise later."""
    with pytest.raises(PackageError, match="is not a package pattern; expected drivers/puppet"):
        UploadTokens(tmp_path / "tokens.json").add("ci", (may,))


@pytest.mark.parametrize("text", ["", "{", '{"format":1,"tokens":[{"name":"x"}]}', "\xff"])
def test_a_damaged_file_of_tokens_lets_nobody_in(lab: Lab, text: str) -> None:
    """The keeper is told by name of the file."""
    lab.tokens.file.write_text(text, encoding="latin-1")
    assert lab.puts(DIAL)[0] == 503
    with pytest.raises(PackageError, match=r"tokens\.json: this is not a token file: "):
        lab.tokens.all()


def test_a_file_without_a_token_is_told(tmp_path: Path) -> None:
    """Also one with more than a token in it."""
    for text in ("", "urc_short", "urc_" + "x" * 43 + "\nmore"):
        (tmp_path / "token").write_text(text)
        with pytest.raises(
            PackageError, match="expected one token, as printed by 'urc repo token add'"
        ):
            read_token(tmp_path / "token")
    with pytest.raises(PackageError, match="No such file"):
        read_token(tmp_path / "gone")
