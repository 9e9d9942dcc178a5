"""`urc people`, `urc devices`, `urc tokens` and `urc sign-ins` on the store of a data folder."""

import io
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import pytest

from urc.access.authority import AUTHORITY_FOLDER, CertificateAuthority
from urc.access.directory import NOBODY
from urc.access.passkey_table import Passkey, PasskeyTable
from urc.access.passphrases import matches
from urc.access.store import AccessStore
from urc.cli.identities import ends_at, minutes_of
from urc.cli.invitation_links import qr_lines
from urc.cli.main import main
from urc.runtime.audit_search import AuditQuery, search
from urc.runtime.running_servers import RunningServer, announced


class Said(NamedTuple):
    """The result of one command."""

    code: int
    output: str
    errors: str


Run = Callable[..., Said]


@pytest.fixture
def urc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    def run(*words: str) -> Said:
        code = main([*words, "--data-dir", str(tmp_path)])
        return Said(code, *capsys.readouterr())

    return run


@pytest.fixture
def store(tmp_path: Path) -> Iterator[AccessStore]:
    with closing(AccessStore(tmp_path)) as opened:
        yield opened


def listed(urc: Run, what: str, *words: str) -> list[dict[str, object]]:
    said = urc(what, "list", "--format", "json", *words)
    assert (said.code, said.errors) == (0, "")
    return [json.loads(line) for line in said.output.splitlines()]


def typed(monkeypatch: pytest.MonkeyPatch, text: bytes) -> None:
    """Let standard input be a pipe with this text."""
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text)))


def test_a_lost_administrator_gets_in_from_the_terminal(
    urc: Run, store: AccessStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert urc("people", "add", "Ann", "--role", "administer").output == "added Ann: administer\n"
    typed(monkeypatch, b"correct horse battery\nanother line\n")
    said = urc("people", "passphrase", "ann")
    assert said == (0, "Ann has a new passphrase; 0 earlier sign-ins ended\n", "")
    who, kept = store.passphrase_of("Ann")
    assert matches("correct horse battery", kept)
    assert store.directory().principals[who].name == "Ann"
    (row,) = listed(urc, "people")
    assert (row["name"], row["roles"], row["has_passphrase"]) == ("Ann", ["administer"], True)


def test_another_passphrase_ends_browsers_but_no_paired_device(
    urc: Run, store: AccessStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    urc("people", "invite", "Ann", "--role", "drive")
    ann = next(iter(store.directory().principals))
    store.open_sign_in(ann, "passphrase", now=time.time())
    phone = store.add("device", "Phone", now=time.time(), owner=ann)
    store.open_sign_in(phone.id, "pairing", now=time.time())
    typed(monkeypatch, b"correct horse battery")
    assert "1 earlier sign-ins ended" in urc("people", "passphrase", "Ann").output
    assert [one.way for one in store.directory().sign_ins.values()] == ["pairing"]
    (row,) = listed(urc, "people")
    assert row["invited_until"] is None, "the link may be in the wrong hands"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"short\n", "the passphrase has 5 characters; at least 8 are needed"),
        (b"", "the passphrase has 0 characters; at least 8 are needed"),
        (b"\xff\xfe is no text", "the passphrase on standard input is not UTF-8"),
        (b"x1y2" * 2000, "the passphrase has 4096 characters; at most 256 are allowed"),
    ],
)
def test_a_bad_passphrase_changes_nothing(
    urc: Run, store: AccessStore, monkeypatch: pytest.MonkeyPatch, text: bytes, message: str
) -> None:
    urc("people", "add", "Ann", "--role", "drive")
    typed(monkeypatch, text)
    assert urc("people", "passphrase", "Ann") == (1, "", f"urc people: {message}\n")
    assert store.passphrase_of("Ann")[1] is None


def test_a_passphrase_is_typed_twice_without_echo(
    urc: Run, store: AccessStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    urc("people", "add", "Ann", "--role", "drive")
    answers = iter(["correct horse battery", "correct horse buttery"] + ["correct horse"] * 2)
    monkeypatch.setattr("getpass.getpass", lambda _: next(answers))
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdin", terminal)
    said = urc("people", "passphrase", "Ann")
    assert said == (1, "", "urc people: the two passphrases differ; nothing was changed\n")
    assert store.passphrase_of("Ann")[1] is None
    assert urc("people", "passphrase", "Ann").code == 0
    assert matches("correct horse", store.passphrase_of("Ann")[1])


def test_roles_are_added_and_taken_away_one_by_one(urc: Run) -> None:
    urc("people", "add", "Ann", "--role", "drive@#lab", "--role", "watch")
    assert urc("people", "grant", "ANN", "--role", "maintain@cart").output == (
        "Ann: drive@#lab, watch, maintain@cart\n"
    )
    assert urc("people", "revoke", "Ann", "--role", "watch").output == (
        "Ann: drive@#lab, maintain@cart\n"
    )
    wrong = urc("people", "revoke", "Ann", "--role", "drive")
    assert wrong.errors == "urc people: Ann has no role drive: drive@#lab, maintain@cart\n"
    assert urc("people", "revoke", "Ann").output == "Ann: no role\n"
    assert urc("people", "rename", "Ann", "Anna  Lee").code == 0
    assert [row["name"] for row in listed(urc, "people")] == ["Anna Lee"]
    assert urc("people", "remove", "anna lee").code == 0
    assert listed(urc, "people") == []
    assert urc("people", "list") == (
        0,
        "",
        "no people yet: 'urc people add NAME --role drive' adds a person\n",
    )


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["people", "add"], 2, "expected 'urc people add NAME', found 0 of 1 arguments"),
        (["people", "add", "Ann"], 2, "'urc people add' requires --role"),
        (["people", "grant", "Ann"], 2, "'urc people grant' requires --role"),
        (["people", "list", "Ann"], 2, "expected 'urc people list', found 1 of 0 arguments"),
        (["people", "remove", "Bem"], 1, "no person has the name 'Bem'; did you mean 'Ben'?"),
        (["people", "remove", "x"], 1, "no person has the name 'x'; known names: Ben"),
        (["people", "add", "ben", "--role", "watch"], 1, "a person already has the name 'ben'"),
        (["people", "invite", "Ann"], 1, "no person has the name 'Ann'; a new person needs a role"),
        (
            ["people", "invite", "Ann", "--valid", "900h"],
            2,
            "--valid: expected at most 336h, found 900h",
        ),
        (
            ["people", "add", "Ann", "--role", "fly"],
            2,
            "--role: expected a role (watch, drive, maintain, administer), found 'fly' in 'fly'",
        ),
        (
            ["devices", "pair", "--owner", "Ben", "--role", "watch"],
            2,
            "use either --owner or --role: with --owner, a device has its owner's roles",
        ),
        (
            ["devices", "pair", "--address", "robots.lab"],
            2,
            "--address: expected an address like https://robots.lab:8080, found 'robots.lab'",
        ),
        (["tokens", "add", "Bot"], 2, "'urc tokens add' requires --role"),
        (["sign-ins", "end"], 2, "'urc sign-ins end' requires either ID…, --of NAME or --all"),
        (
            ["sign-ins", "end", "beef"],
            1,
            "no sign-in begins with 'beef'; 'urc sign-ins list' shows the ids",
        ),
        (
            ["sign-ins", "end", "--of", "x"],
            1,
            "no person, device or program has the name 'x'",
        ),
    ],
)
def test_wrong_use_is_one_line_and_changes_nothing(
    urc: Run, store: AccessStore, words: list[str], code: int, message: str
) -> None:
    urc("people", "add", "Ben", "--role", "drive")
    before = store.directory()
    assert urc(*words) == (code, "", f"urc {words[0]}: {message}\n")
    assert store.directory() == before
    with store.transaction() as base:
        assert base.execute("SELECT count(*) FROM invitations").fetchone() == (0,)


def test_a_mistyped_folder_is_not_created(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mistyped"
    assert main(["people", "list", "--data-dir", str(folder)]) == 1
    assert capsys.readouterr().err == (
        f"urc people: {folder} is not a folder; select the folder of 'urc serve'\n"
    )
    assert not folder.exists()
    assert main(["people", "add", "Ann", "--role", "drive", "--data-dir", str(folder)]) == 0


def test_a_token_is_shown_once_and_has_its_scope(urc: Run, store: AccessStore) -> None:
    said = urc("tokens", "add", "Night", "--role", "drive@cart", "--commands", "goto, dock")
    token = said.output.strip()
    assert "the token of Night (drive@cart; goto, dock) ends: " in said.errors
    assert token not in said.errors
    who = store.directory().identify(token, time.time())
    assert (who.name, who.kind, who.way) == ("Night", "program", "token")
    directory = store.directory()
    assert directory.role(who, time.time(), "cart") == "drive"
    assert [directory.may_give(who, one) for one in ("goto", "arm")] == [True, False]
    assert directory.role(who, time.time() + 91 * 86400, "cart") is None, "90 days"
    (row,) = listed(urc, "tokens")
    assert (row["commands"], row["is_valid"], row["last_use"]) == (["goto", "dock"], True, None)
    assert token not in store.file.read_bytes().decode("latin-1")
    assert urc("tokens", "remove", "night").code == 0
    assert store.directory().identify(token, time.time()) == NOBODY


def test_a_pairing_code_is_valid_for_two_minutes_and_once(urc: Run, store: AccessStore) -> None:
    said = urc("devices", "pair", "--name", "Tablet", "--role", "drive@#lab")
    code = said.output.strip()
    assert "no server is running" in said.errors
    assert "pairs one device (drive@#lab): works once, valid for 2 minutes" in said.errors
    invitation = store.redeem(code, time.time() + 110)
    assert invitation is not None
    assert (invitation.kind, invitation.name, invitation.owner) == ("device", "Tablet", "")
    assert [str(one) for one in invitation.grants] == ["drive@#lab"]
    late = urc("devices", "pair").output.strip()
    assert store.redeem(late, time.time() + 121) is None


def test_a_device_of_a_person_has_the_roles_of_the_owner(urc: Run, store: AccessStore) -> None:
    urc("people", "add", "Ann", "--role", "drive")
    code = urc("devices", "pair", "--owner", "ann").output.strip()
    invitation = store.redeem(code, time.time())
    assert invitation is not None
    assert (invitation.grants, invitation.owner) == ((), next(iter(store.directory().principals)))
    phone = store.add("device", "Phone", now=time.time(), owner=invitation.owner)
    store.open_sign_in(phone.id, "pairing", now=time.time())
    (row,) = listed(urc, "devices")
    assert (row["owner"], row["roles"], row["is_paired"]) == ("Ann", None, True)
    said = urc("devices", "grant", "Phone", "--role", "watch")
    assert said.errors == (
        "urc devices: Phone has the roles of its owner; change the owner's roles instead\n"
    )
    taken = urc("devices", "pair", "--name", "phone")
    assert taken.errors == "urc devices: a device already has the name 'phone'\n"
    assert urc("devices", "rename", "Phone", "Old phone").code == 0
    assert urc("devices", "remove", "old phone").code == 0
    assert not store.directory().sign_ins


def test_sign_ins_end_by_id_by_name_and_at_the_end_of_a_shift(urc: Run, store: AccessStore) -> None:
    now = time.time()
    ann, ben = (store.add("person", name, now=now) for name in ("Ann", "Ben"))
    tablet = store.add("device", "Tablet", now=now)
    first, _ = store.open_sign_in(
        ann.id, "passphrase", now=now, place="192.0.2.7", agent="Chromium on Android", idle_s=3600
    )
    for one, way in ((ann, "passkey"), (ben, "passphrase"), (ben, "oidc"), (tablet, "pairing")):
        store.open_sign_in(one.id, way, now=now)  # type: ignore[arg-type]
    store.open_sign_in(ann.id, "passphrase", now=now - 9000, ends_at=now - 1)
    rows = listed(urc, "sign-ins")
    assert len(rows) == 5, "without the one that is over"
    (own,) = [row for row in rows if row["id"] == first.id]
    assert (own["name"], own["agent"], own["place"]) == ("Ann", "Chromium on Android", "192.0.2.7")
    assert own["ends"] is not None
    assert len(listed(urc, "sign-ins", "--of", "ben")) == 2
    assert urc("sign-ins", "end", first.id[:8]).output == "1 sign-in ended\n"
    assert urc("sign-ins", "end", "--of", "BEN").output == "2 sign-ins ended\n"
    urc("sign-ins", "end", "--all")
    assert [one.way for one in store.directory().sign_ins.values()] == ["pairing"]


def test_links_lead_to_the_running_server(urc: Run, store: AccessStore, tmp_path: Path) -> None:
    here = RunningServer("http://127.0.0.1:8080/", "key", os.getpid())
    with announced(tmp_path, "here", here):
        said = urc("people", "invite", "Ann", "--role", "drive")
        assert re.fullmatch(r"http://127\.0\.0\.1:8080/join#[\w-]{22}\n", said.output)
        assert "accepts clients on this machine only" in said.errors
        public = here._replace(public="https://192.0.2.7:8080/")
        with announced(tmp_path, "public", public):
            said = urc("devices", "pair")
    assert re.fullmatch(r"https://192\.0\.2\.7:8080/pair#[\w-]{22}\n", said.output), "no QR code"
    assert "this machine only" not in said.errors
    code = said.output.strip().partition("#")[2]
    assert store.redeem(code, time.time()) is not None
    by_name = urc("devices", "pair", "--address", "https://robots.lab/").output
    assert by_name.startswith("https://robots.lab/pair#")


def test_the_fingerprint_of_the_authority_is_shown(urc: Run, tmp_path: Path) -> None:
    authority = CertificateAuthority(tmp_path / AUTHORITY_FOLDER, ["lab.local"], datetime.now(UTC))
    said = urc("devices", "pair", "--address", "https://lab.local/")
    assert authority.fingerprint in said.errors
    authority.file.write_text("damaged")
    said = urc("devices", "pair", "--address", "https://lab.local/")
    assert said.code == 0
    assert "this certificate is damaged" in said.errors


def test_a_qr_code_is_black_on_white_in_any_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cell sets both colours; the modules are those of the library."""
    import segno

    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), "utf-8"))
    text = "https://192.0.2.7:8080/pair#abcdefghijklmnopqrstuv"
    lines = list(qr_lines(text, 80))
    rows: list[list[int]] = []
    for line in lines:
        cells = re.findall(r"\x1b\[38;5;(16|231);48;5;(16|231)m▀", line)
        assert line == "".join(f"\x1b[38;5;{a};48;5;{b}m▀" for a, b in cells) + "\x1b[0m"
        rows.append([int(top == "16") for top, _ in cells])
        rows.append([int(bottom == "16") for _, bottom in cells])
    wanted = [
        list(map(int, row))
        for row in segno.make(text, error="l", micro=False).matrix_iter(border=4)
    ]
    assert rows[: len(wanted)] == wanted
    assert rows[len(wanted) :] in ([], [[0] * len(wanted)])
    assert len(lines) <= 24
    assert not list(qr_lines(text, 30)), "too narrow"
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), "ascii"))
    assert not list(qr_lines(text, 80)), "no half blocks"


def test_changes_are_in_the_audit_log_without_secrets(
    urc: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = urc("people", "invite", "Ann", "--role", "drive").output.strip()
    typed(monkeypatch, b"correct horse battery")
    urc("people", "passphrase", "Ann")
    token = urc("tokens", "add", "Bot", "--role", "watch").output.strip()
    urc("people", "list")
    found = search(tmp_path / "audit.sqlite", AuditQuery())
    entries = [row.entry for row in reversed(found)]
    assert [one.command for one in entries] == ["people invite", "people passphrase", "tokens add"]
    assert all(one.who.endswith(" on this computer") for one in entries)
    assert json.loads(entries[0].arguments) == {"name": "Ann", "roles": "drive"}
    everything = (tmp_path / "audit.sqlite").read_bytes() + repr(entries).encode()
    for secret in (code, token, "correct horse battery"):
        assert secret.encode() not in everything


def test_an_end_is_a_span_or_a_day() -> None:
    now = time.time()
    assert ends_at("never") is None
    assert ends_at("8h") == pytest.approx(now + 8 * 3600, abs=5)
    tomorrow = time.localtime(now + 86400)
    end = ends_at(time.strftime("%Y-%m-%d", tomorrow))
    assert end is not None
    assert time.strftime("%H:%M", time.localtime(end)) == "00:00"
    assert end - now + 3600 >= 86400, "to the end of that day"
    for wrong in ("0d", "30", "99999d", "2020-01-01", "2999-01-01", "soon", ""):
        with pytest.raises(Exception, match="expected a future time"):
            ends_at(wrong)


def test_durations_are_for_people() -> None:
    lengths = (30, 60, 120, 5400, 3600, 86400, 172800)
    assert [minutes_of(one) for one in lengths] == [
        "30 seconds", "1 minute", "2 minutes", "90 minutes", "1 hour", "1 day", "2 days",
    ]  # fmt: skip


def test_passkeys_are_listed_and_removed(urc: Run, store: AccessStore) -> None:
    ann = store.add("person", "Ann", now=1.0)
    table = PasskeyTable(store)
    for name, used_at in (("old phone", 1.0), ("tablet", 5.0)):
        passkey = f"{name[0]}-id-of-the-passkey"
        table.add(Passkey(passkey, ann.id, name, "cart.lab", b"key", 0, 1.0, used_at))
    for way in ("passkey", "passphrase"):
        store.open_sign_in(ann.id, way, now=time.time())  # type: ignore[arg-type]
    said = urc("people", "passkeys", "ann", "--format", "json")
    rows = [json.loads(line) for line in said.output.splitlines()]
    assert [(row["name"], row["host"], row["last_use"]) for row in rows] == [
        ("old phone", "cart.lab", None),
        ("tablet", "cart.lab", "1970-01-01T00:00:05Z"),
    ]
    assert "o-id-of-" in urc("people", "passkeys", "Ann").output
    missing = urc("people", "remove-passkey", "Ann", "watch")
    assert (missing.code, "Ann has no passkey 'watch'" in missing.errors) == (1, True)
    removed = urc("people", "remove-passkey", "Ann", "Old Phone")
    assert removed.output == "removed the passkey old phone of Ann; 1 sign-ins ended\n"
    assert [one.name for one in table.of(ann.id)] == ["tablet"]
    assert [one.way for one in store.directory().sign_ins.values()] == ["passphrase"]
    assert urc("people", "remove-passkey", "Ann", "t-id").code == 0
    assert "Ann has no passkeys" in urc("people", "passkeys", "Ann").errors
