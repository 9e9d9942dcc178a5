"""What a repository says beside a package: that it is withdrawn, and where it was made."""

import base64
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from tests.unit.packages.made import install, package
from tests.unit.packages.test_door import BOT, DIAL, DIAL_2, Lab, fine
from urc.packages.index import INDEX, IndexEntry, entry_of, read_index, search
from urc.packages.index_builder import make_index, notes_of, withdraw
from urc.packages.install import origin_lines, plan_requirement, withdrawn_lines
from urc.packages.install_plan import InstallPlan
from urc.packages.names import PackageError, parse_requirement
from urc.packages.package import Package
from urc.packages.store import Store
from urc.packages.update import newer, plan_update
from urc.packages.version_notes import PROVENANCE, Notes, Provenance

WHY = "It sticks."
MADE = {"source": "https://git.example/dial", "commit": "0123abc", "tool": "urc 1.0"}


class Noted:
    """A repository that has said something about some of its packages."""

    name = "http://lab/"

    def __init__(self, *packages: Package, withdrawn: Sequence[Package] = ()) -> None:
        self._packages = {one.digest: one for one in packages}
        self._gone = {one.digest for one in withdrawn}

    def entries(self) -> tuple[IndexEntry, ...]:
        return tuple(
            entry_of(one, notes=Notes(WHY) if digest in self._gone else None)
            for digest, one in self._packages.items()
        )

    def fetch(self, entry: IndexEntry) -> bytes:
        return self._packages[entry.sha256].data


def planned(store: Store, required: str, there: Noted, *, takes: bool = False) -> InstallPlan:
    """Return what a wish comes to."""
    return plan_requirement(
        parse_requirement(required), [there], store, lambda line: None, takes_withdrawn=takes
    )


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "packages")


def test_what_is_withdrawn_is_not_taken_unless_it_is_asked_for(store: Store) -> None:
    """The version before is; by name it is told why, and how to have it all the same."""
    there = Noted(BOT, DIAL, DIAL_2, withdrawn=[DIAL_2])
    assert planned(store, "dial", there).lock.version == "1.0.0"
    assert planned(store, "bot", there).lock.packages["widgets/dial"].version == "1.0.0"
    with pytest.raises(PackageError) as refused:
        planned(store, "dial@1.1.0", there)
    assert str(refused.value).endswith(
        f"; widgets/dial 1.1.0 was withdrawn: {WHY}; --withdrawn installs it anyway"
    )
    plan = planned(store, "dial@1.1.0", there, takes=True)
    assert origin_lines(plan, store)[0].endswith(f"not signed; WITHDRAWN: {WHY}")
    assert [str(one) for one in search(there.entries(), ["dial"])] == ["widgets/dial 1.0.0"]


def test_a_package_of_which_nothing_is_offered_comes_from_nowhere_else(store: Store) -> None:
    """A second repository does not slip one in under its name."""
    with pytest.raises(PackageError, match=r"widgets/dial 1.0.0 was withdrawn"):
        plan_requirement(
            parse_requirement("dial"),
            [Noted(DIAL, withdrawn=[DIAL]), Noted(DIAL_2)],
            store,
            lambda line: None,
        )


def test_a_lock_takes_what_it_names(store: Store) -> None:
    """Else a robot could not be set up again as it was."""
    lock = planned(store, "dial", Noted(DIAL)).lock
    there = Noted(DIAL, withdrawn=[DIAL])
    plan = plan_requirement(parse_requirement("dial"), [there], store, lambda line: None, lock)
    assert plan.lock == lock
    assert plan.archives


def test_who_has_it_installed_is_told(store: Store) -> None:
    """Also of what came along; other bytes of that version are not meant, and no update is it."""
    old = install(store, BOT, DIAL)
    there = Noted(BOT, DIAL, DIAL_2, withdrawn=[DIAL, DIAL_2])
    assert withdrawn_lines(old, there.entries()) == [f"widgets/dial 1.0.0 was withdrawn: {WHY}"]
    other = package("widget", "dial", notes="more")
    assert withdrawn_lines(old, Noted(other, withdrawn=[other]).entries()) == []
    there = Noted(BOT, DIAL, DIAL_2, withdrawn=[DIAL_2])
    assert newer(store, [there], lambda line: None) == []
    assert plan_update(old, [there], store, lambda line: None) is None


def test_what_is_withdrawn_stays_so(tmp_path: Path) -> None:
    """When the folder is indexed anew, and when it is published once more; nobody may need it."""
    lab = Lab(tmp_path)
    with lab.client:
        lab.puts(DIAL)
        (dial,) = read_index((lab.folder / INDEX).read_bytes(), INDEX).packages
        withdraw(lab.folder, dial.key, "1.0.0", WHY, None)
        assert lab.puts(DIAL)[0] == 200
        (again,) = make_index(lab.folder, "Lab", fine).listed.packages
        assert again.why_withdrawn == WHY
        status, told = lab.puts(BOT)
        assert (status, "widgets/dial" in told) == (422, True)
        with pytest.raises(PackageError, match="a reason on one line"):
            withdraw(lab.folder, dial.key, "1.0.0", "two\nlines", None)
        assert withdraw(lab.folder, dial.key, "1.0.0", "", None) == dial
        assert lab.puts(BOT)[0] == 201


def test_where_it_was_made_is_kept_and_told(tmp_path: Path) -> None:
    """With the first who says it; another place for the same version is refused."""
    lab = Lab(tmp_path)
    with lab.client:
        assert publish(lab, MADE) == 201
        assert publish(lab, MADE) == 200
        assert publish(lab, {**MADE, "commit": "fffffff"}) == 409
        (dial,) = make_index(lab.folder, "Lab", fine).listed.packages
        assert str(dial.provenance) == "made from https://git.example/dial at 0123abc by urc 1.0"
        withdraw(lab.folder, dial.key, "1.0.0", WHY, None)
        (dial,) = make_index(lab.folder, "Lab", fine).listed.packages
        assert notes_of(dial) == Notes(WHY, msgspec.convert(MADE, Provenance))


def test_an_index_may_say_more_of_where_it_was_made_than_is_known_here() -> None:
    """That of a newer repository: it is read all the same."""
    made = {"source": "git+ssh://git.example/dial", "commit": "r7", "colour": "red"}
    entry = msgspec.to_builtins(Noted(DIAL).entries()[0]) | {"provenance": made}
    data = msgspec.json.encode({"format": 1, "name": "Lab", "packages": [entry]})
    (found,) = read_index(data, INDEX).packages
    assert str(found.provenance) == "made from git+ssh://git.example/dial at r7"


@pytest.mark.parametrize(
    "said",
    [
        {"source": "javascript:alert(1)"},
        {"source": "https://x.example/\n"},
        {"source": "https://x.example/", "commit": "not hex"},
        {"source": "https://x.example/", "tool": "x" * 101},
        {"tool": "urc 1.0"},
        "text",
    ],
)
def test_nonsense_about_where_it_was_made_is_refused(tmp_path: Path, said: object) -> None:
    """In one line, and nothing is listed."""
    lab = Lab(tmp_path)
    with lab.client:
        assert publish(lab, said) == 400
        assert lab.lists() == []


def publish(lab: Lab, made: object) -> int:
    """Publish the dial, and say where it was made; return the status."""
    headers = {
        "authorization": f"Bearer {lab.token}",
        PROVENANCE: base64.b64encode(msgspec.json.encode(made)).decode(),
    }
    file = "archives/widgets/dial/1.0.0.zip"
    answer = lab.client.put(file, content=DIAL.data, headers=headers)
    assert "\n" not in answer.text
    return answer.status_code
