"""The file of rules is followed while the server runs; a wrong file never admits anybody."""

from pathlib import Path

import pytest

from tests.unit.fleet.fleets import NOW, Place
from urc.cli.main import main
from urc.fleet.faults import membership_faults
from urc.fleet.rules import OPEN
from urc.fleet.rules_file import RULES_FILE, RulesFile

HEAD = "urc: 1\nkind: site-rules\n"


def write(folder: Path, text: str) -> Path:
    file = folder / RULES_FILE
    file.write_text(HEAD + text, encoding="utf-8")
    return file


def followed(rules: RulesFile) -> bool:
    """Return whether two looks find and read a change."""
    rules.has_changed()
    if not rules.has_changed():
        return False
    rules.reread()
    return True


def test_a_change_counts_as_soon_as_it_has_settled(tmp_path: Path) -> None:
    """The first look may see half of a file."""
    rules = RulesFile(write(tmp_path, "otherwise: watch\n"))
    assert not rules.has_changed()
    write(tmp_path, "otherwise: drive\nrules: []\n")
    assert not rules.has_changed()
    assert rules.has_changed()
    rules.reread()
    assert rules.rules.otherwise == "drive"
    assert not followed(rules)


def test_a_wrong_file_and_a_removed_file_refuse_everybody(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rules = RulesFile(write(tmp_path, "otherwise: drive\n"))
    write(tmp_path, "otherwise: everybody\n")
    assert followed(rules)
    assert f"{tmp_path / RULES_FILE}:3:12: error" in rules.rules.fault
    (tmp_path / RULES_FILE).unlink()
    assert followed(rules)
    assert rules.rules.fault.endswith("the file was removed; restore it, or restart the server")
    assert all("no visitors from other sites are admitted" in one for one in caplog.messages)
    write(tmp_path, "otherwise: watch\n")
    assert followed(rules)
    assert rules.rules.fault == ""


def test_a_file_that_appears_counts(tmp_path: Path) -> None:
    rules = RulesFile(tmp_path / RULES_FILE)
    assert rules.rules is OPEN
    assert not followed(rules)
    write(tmp_path, "otherwise: none\n")
    assert followed(rules)
    assert rules.rules.otherwise is None


def test_a_file_that_cannot_be_read_refuses_everybody(tmp_path: Path) -> None:
    (tmp_path / RULES_FILE).mkdir()
    assert RulesFile(tmp_path / RULES_FILE).rules.fault
    other = tmp_path / "other"
    other.mkdir()
    (other / RULES_FILE).symlink_to(other / "missing")
    assert RulesFile(other / RULES_FILE).rules.fault


def test_the_doctor_says_each_mistake_in_one_line(tmp_path: Path) -> None:
    hall = Place(tmp_path).member()
    write(hall.folder, "otherwise: watch\nrules: [{ name: a, role: drive, days: [mon] }]\n")
    (line,) = membership_faults(hall.folder, NOW)
    assert line == (
        f"{hall.folder / RULES_FILE}:4:33: error missing-key rules.0.days: 'days' requires the key"
        " 'time_zone' of the document; add for example: time_zone: Europe/Zurich"
    )


def run(folder: Path, *words: str) -> int:
    return main(["fleet", "rules", *words, "--data-dir", str(folder.parent)])


@pytest.fixture
def member(tmp_path: Path) -> Path:
    """Return the folder of a membership in a data folder."""
    made = Place(tmp_path).member()
    data = tmp_path / "data"
    data.mkdir()
    return made.folder.rename(data / "fleet")


def test_the_command_shows_the_rules(member: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(member) == 0
    said = capsys.readouterr()
    assert "(otherwise)  drive" in said.out
    assert "visitors from all sites may drive" in said.err
    write(
        member,
        "time_zone: UTC\nrules: [{ name: day, role: drive, people: [Ann], days: [mon] }]\n"
        "otherwise: none\n",
    )
    assert run(member) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [line.split() for line in rows[1:]] == [
        ["day", "drive", "all", "Ann", "all", "all", "mon"],
        ["(otherwise)", "none", "all", "all", "all", "all", "always"],
    ]


def test_the_command_answers_what_a_visitor_may_do(
    member: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(
        member,
        "rules: [{ name: lab, role: drive, networks: [10.0.0.0/8], robots: ['#lab'] }]\n"
        "otherwise: watch\n",
    )
    assert run(member, "check", "Ann@zug", "cart", "--device", "10.1.1.1", "--tag", "lab") == 0
    assert capsys.readouterr().out == "drive: the rule “lab”\n"
    assert run(member, "check", "Ann@zug", "cart", "--format", "json") == 0
    assert '"role": "watch"' in capsys.readouterr().out
    for words in (("check", "Ann"), ("check", "Ann", "cart"), ("Ann",)):
        assert run(member, *words) == 2
    assert run(member, "check", "Ann@zug", "cart", "--device", "hall") == 1
    assert "--device: expected a network address" in capsys.readouterr().err


def test_the_command_says_each_mistake(member: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(member, "otherwise: watch\ntime_zone: Mars\nrules: [{ name: a, role: king }]\n")
    assert run(member) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"{member / RULES_FILE}:5:")
    assert lines[-1] == "urc fleet: the site admits no visitors until the file is correct"
