"""From one's own folder into a repository, and on to other people: published, signed, updated."""

import json
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.request import urlopen

import pytest

from tests.e2e.command_line import TIMEOUT_S
from tests.e2e.package_people import Person
from tests.e2e.processes import UrcProcess
from tests.unit.packages.made import DOCUMENTS, package, write_package
from urc.runtime.package_check import examine, examine_apart

LOOK = "widgets:\n  battery: { use: dial, bind: { level: battery } }\n"
TEST = 'tests:\n  - { name: it is heard, feed: { wire: "42\\n" }, expect: { battery: 42 } }\n'
UNUSED = "  key: { type: string, secret: true }\n"
DRIVER = DOCUMENTS["driver"].replace(UNUSED, "") + LOOK + TEST


class Lab:
    """A repository that takes packages, and the folder in which somebody writes them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "lab"
        self.folder.mkdir()
        self.home = folder / "home"
        self.tokens = folder / "tokens.json"
        self.token = folder / "token"
        self._process = UrcProcess(
            ["repo", "serve", str(self.folder), "--port", "0", "--tokens", str(self.tokens)], {}
        )
        self.url = ""

    def is_open(self) -> None:
        self.url = self._process.wait_for(r"^repository (http://\S+)$")[1]

    def end(self) -> None:
        self._process.kill()

    def writes(self, version: str, driver: str = DRIVER) -> tuple[str, str]:
        """Write a widget and a driver that needs it; return their folders."""
        dial = write_package(self.home, "widget", "dial", version)
        needs = {"widgets/dial": f"^{version}"}
        puppet = write_package(self.home, "driver", "puppet", version, needs, text=driver)
        return str(dial), str(puppet)

    def lists(self) -> list[str]:
        with urlopen(f"{self.url}index.json", timeout=TIMEOUT_S) as answer:  # noqa: S310 (ours)
            packages = json.load(answer)["packages"]
        return [f"{one['name']} {one['version']}" for one in packages]

    def holds(self) -> dict[str, bytes]:
        return {
            str(file.relative_to(self.folder)): file.read_bytes()
            for file in self.folder.rglob("*")
            if file.is_file() and file.name != ".changing"
        }

    @property
    def to(self) -> tuple[str, ...]:
        return "--to", self.url, "--token-file", str(self.token)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    made = Lab(tmp_path)
    try:
        made.is_open()
        yield made
    finally:
        made.end()


@pytest.fixture
def people(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], Person]:
    return lambda name: Person(tmp_path / name, capsys, monkeypatch)


def test_what_one_publishes_another_installs_updates_and_undoes(
    lab: Lab, people: Callable[[str], Person]
) -> None:
    """Signed all the way, with what changes shown before."""
    anna, ben = people("anna"), people("ben")
    token = anna.does("repo", "token", "add", "ci", "--may", "*", "--tokens", str(lab.tokens))
    lab.token.write_text(token)
    assert anna.does("repo", "token", "list", "--tokens", str(lab.tokens)) == "ci  *\n"
    key = anna.does("repo", "key", "new", "Anna").partition(",")[0]
    assert key.startswith("Anna (SHA256:")
    assert anna.does("repo", "key", "show") == f"{key}\n"
    made = ("--source", "https://git.example/puppet", "--commit", "0123abc")
    told = anna.does("publish", *lab.writes("1.0.0"), *lab.to, *made)
    assert told == (
        f"published widgets/dial 1.0.0, signed by {key}\n"
        f"published drivers/puppet 1.0.0, signed by {key}\n"
    )
    assert anna.does("publish", *lab.writes("1.0.0"), *lab.to).count("already there: ") == 2

    ben.does("repo", "add", lab.url)
    assert (
        ben.does("search", "dial", "--kind", "widget") == "widgets/dial 1.0.0  The widget dial.\n"
    )
    other = f"SHA256:{'A' * 43}"
    told = ben.refuses("install", "puppet", "--yes", "--signed-by", other)
    assert f"drivers/puppet 1.0.0 is signed by {key}, expected a signature by {other}" in told
    fingerprint = key.partition("(")[2].rstrip(")")
    told = ben.does("install", "puppet", "--yes", "--signed-by", fingerprint)
    assert (
        f"from {lab.url}, signed by {key}, a key seen for the first time;"
        " made from https://git.example/puppet at 0123abc by urc "
    ) in told
    assert ben.does("list", "--updates") == ""
    assert ben.does("update") == "drivers/puppet 1.0.0 is up to date\n"

    more = DRIVER.replace('send: "beep"', 'send: "BEEP"').replace("6789", "7000")
    anna.does("publish", *lab.writes("1.1.0", more), *lab.to)
    assert ben.does("list", "--updates") == (
        "drivers/puppet 1.0.0 → 1.1.0  with widgets/dial 1.0.0 → 1.1.0\n"
    )
    assert "cannot ask without a terminal" in ben.does("update", code=2)
    assert "the package gains permissions" in ben.does("update", "--yes", code=1)
    assert ben.does("list") == "drivers/puppet 1.0.0  with widgets/dial 1.0.0\n"
    told = ben.does("update", "puppet", "--yes", "--allow-more")
    for line in (
        f"signed by {key}, as before",
        "  new permission: connects by tcp (wire)",
        "  lost permission: connects by tcp (wire)",
        '    - commands.beep.send: "beep"\n    + commands.beep.send: "BEEP"',
        "updated drivers/puppet to 1.1.0; undo with 'urc update --back drivers/puppet'",
    ):
        assert line in told
    _is_withdrawn(lab, anna, ben, people("dora"))
    lab.end()  # the way back needs nobody
    told = ben.does("update", "--back", "puppet")
    assert told == "drivers/puppet is restored to 1.0.0, the version before 1.1.0\n"
    assert ben.does("list") == "drivers/puppet 1.0.0  with widgets/dial 1.0.0\n"
    bundle = str(lab.token.parent / "puppet.urcof")
    ben.does("bundle", "puppet", "--to", bundle)
    cleo = people("cleo")
    told = cleo.does("install", bundle, "--yes")
    assert told.count(f"signed by {key}, a key seen for the first time") == 2
    assert "widgets/dial  SHA256:" in cleo.does("repo", "key", "list")
    again = str(lab.token.parent / "again.urcof")
    cleo.does("bundle", "puppet", "--to", again)
    assert Path(again).read_bytes() == Path(bundle).read_bytes()


def _is_withdrawn(lab: Lab, keeper: Person, owner: Person, other: Person) -> None:
    """The owner is told why, others get the version before, or it by name."""
    why = "It beeps too loud."
    version = (str(lab.folder), "drivers/puppet", "1.1.0")
    assert "requires --why" in keeper.does("repo", "withdraw", *version, code=2)
    assert "'1.2.0'" not in keeper.refuses("repo", "withdraw", *version[:2], "1.2.0", "--why", why)
    keeper.does("repo", "withdraw", *version, "--why", why)
    assert owner.does("list", "--updates") == ""
    assert owner.does("list") == (
        "drivers/puppet 1.1.0  with widgets/dial 1.1.0\n"
        f"  ▲ drivers/puppet 1.1.0 was withdrawn: {why}\n"
    )
    other.does("repo", "add", lab.url)
    told = other.refuses("install", "puppet@1.1.0", "--yes")
    assert f"drivers/puppet 1.1.0 was withdrawn: {why}; --withdrawn installs it anyway" in told
    assert "installed drivers/puppet 1.0.0" in other.does("install", "puppet", "--yes")
    told = other.does("install", "puppet@1.1.0", "--yes", "--allow-more", "--withdrawn")
    assert f"; WITHDRAWN: {why}" in told
    keeper.does("repo", "restore", *version)
    assert other.does("search", "puppet") == "drivers/puppet 1.1.0  The driver puppet.\n"
    assert "withdrawn" not in other.does("list")


def test_what_is_wrong_is_refused_in_one_line(
    lab: Lab, people: Callable[[str], Person], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the client or the repository, which then lists what it listed before."""
    anna = people("anna")
    token = anna.does("repo", "token", "add", "x", "--may", "widgets/*", "--may", "drivers/pup*",
                      "--tokens", str(lab.tokens))  # fmt: skip
    lab.token.write_text(token)
    dial, puppet = lab.writes("1.0.0")
    assert "drivers/puppet 1.0.0 needs ^1.0.0; there is none" in anna.refuses(
        "publish", puppet, *lab.to
    )
    told = anna.does("publish", dial, puppet, *lab.to)
    assert told == (
        "published widgets/dial 1.0.0, not signed\npublished drivers/puppet 1.0.0, not signed\n"
    )
    before = lab.holds()

    _, broken = lab.writes("1.1.0", DRIVER.replace("42\\n", "43\\n"))
    anna.does("publish", dial, *lab.to)
    before = lab.holds()
    assert "drivers/puppet/driver.yaml:" in (told := anna.refuses("publish", broken, *lab.to))
    assert "test 'it is heard'" in told
    assert str(lab.folder) not in told
    car = str(write_package(lab.home, "driver", "car"))
    told = anna.refuses("publish", car, *lab.to)
    assert "warning unused-setting settings.key:" in told
    assert "; --allow-warnings publishes the package despite warnings" in told
    told = anna.refuses("publish", car, *lab.to, "--allow-warnings")
    assert "the token 'x' may publish" in told
    module = (lab.home / "widgets/dial/widget.js").rename(lab.home / "kept.js")
    assert "widget.js" in anna.refuses("publish", dial, *lab.to)
    module.rename(lab.home / "widgets/dial/widget.js")
    (lab.home / "widgets/dial/notes.txt").write_text("more")
    assert "listed with different content" in anna.refuses("publish", dial, *lab.to)
    (lab.home / "widgets/dial/notes.py").write_text("more")
    assert "files of this type are not allowed" in anna.refuses("publish", dial, *lab.to)
    (lab.home / "widgets/dial/notes.py").unlink()
    anna.does("repo", "token", "remove", "x", "--tokens", str(lab.tokens))
    assert "this repository needs a token" in anna.refuses("publish", dial, *lab.to)
    for url in ("http://robots.example/", "http://192.168.1.5:8090/"):
        told = anna.does("publish", dial, "--to", url, "--token-file", str(lab.token), code=2)
        assert f"{url} is not encrypted: an attacker on the network can read the token" in told
    inside = str(lab.folder / "tokens.json")
    told = anna.does("repo", "serve", str(lab.folder), "--tokens", inside, code=2)
    assert "this file is inside the published repository" in told
    assert lab.holds() == before

    _is_cut_off(lab, package("widget", "dial", "3.0.0").data)
    assert lab.lists() == ["puppet 1.0.0", "dial 1.0.0", "dial 1.1.0"]
    assert lab.holds() == before


def _is_cut_off(lab: Lab, data: bytes) -> None:
    """Send half of an archive, and go away."""
    host, _, port = lab.url.removeprefix("http://").rstrip("/").rpartition(":")
    head = (
        "PUT /archives/widgets/dial/3.0.0.zip HTTP/1.1\r\nhost: x\r\n"
        f"authorization: Bearer {lab.token.read_text().strip()}\r\n"
        f"content-length: {len(data)}\r\n\r\n"
    )
    with socket.create_connection((host, int(port)), TIMEOUT_S) as line:
        line.sendall(head.encode() + data[: len(data) // 2])


def test_what_a_stranger_sends_is_looked_at_within_bounds(tmp_path: Path) -> None:
    """By a process of its own: one that takes too long is a fault like any other."""
    home = write_package(tmp_path, "driver", "puppet", text=DRIVER.replace(LOOK, ""))
    document = home / "driver.yaml"
    assert examine_apart(document) == examine(document) == []
    document.write_text(document.read_text().replace("42\\n", "43\\n"))
    (fault,) = examine_apart(document)
    assert [fault] == examine(document)
    assert "test 'it is heard'" in fault
    (fault,) = examine_apart(document, total_s=0.01)
    assert fault == f"{document}: the check took longer than 0.01 s"
    (fault,) = examine_apart(document.with_name("gone.yaml"))
    assert "gone.yaml" in fault
