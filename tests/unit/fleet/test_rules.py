"""The rules of a site: the first one that applies decides, and the refusal names it."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.fleet.rules import OPEN, Applicant, Decision, Hours, SiteRule, SiteRules
from urc.fleet.rules_file import read_rules
from urc.model.role import ROLES, Role
from urc.problems import ProblemsError

HEAD = "urc: 1\nkind: site-rules\n"
SHIFT = """
time_zone: Europe/Zurich
rules:
  - { name: guests, role: none, sites: [zug], people: [Eve] }
  - { name: day shift, role: drive, sites: [zug], robots: [cart, "#lab"],
      networks: [10.0.0.0/8, "fd00::/8"], days: [mon, tue, wed, thu, fri],
      hours: ["07:00-12:00", "13:00-18:00"] }
otherwise: watch
"""
ANN = Applicant("zug", "Ann", False, "10.0.0.7", "cart")
TUESDAY_10 = datetime(2026, 12, 1, 9, 0, tzinfo=UTC).timestamp()
"""10:00 in Zurich."""
H = 3600.0


def rules(text: str, folder: Path) -> SiteRules:
    file = folder / "rules.yaml"
    file.write_text(HEAD + text, encoding="utf-8")
    return read_rules(file)


def decided(
    found: SiteRules, who: Applicant = ANN, now: float = TUESDAY_10, proposed: Role = "drive"
) -> Decision:
    return found.decided(who, proposed, now, "bern")


def test_a_rule_applies_if_all_its_conditions_are_met(tmp_path: Path) -> None:
    shift = rules(SHIFT, tmp_path)
    assert decided(shift) == Decision("drive", "day shift")
    assert decided(shift, ANN._replace(place="fd00::7")).role == "drive"
    assert decided(shift, ANN._replace(place="::ffff:10.0.0.7")).role == "drive"
    assert decided(shift, ANN._replace(robot="crane", tags=("lab",))).role == "drive"
    other = (
        ANN._replace(site="thun"),
        ANN._replace(place="192.168.1.7"),
        ANN._replace(place="fe80::7%eth0"),
        ANN._replace(place=""),
        ANN._replace(place="localhost"),
        ANN._replace(robot="crane"),
        ANN._replace(robot="lab"),
    )
    for who in other:
        assert decided(shift, who).role == "watch", who


@pytest.mark.parametrize(
    ("hours", "role"),
    [(-3.1, "watch"), (-3, "drive"), (1.9, "drive"), (2, "watch"), (3, "drive"), (8, "watch")],
)
def test_hours_count_in_the_time_zone_of_the_site(tmp_path: Path, hours: float, role: Role) -> None:
    """The end is exclusive."""
    assert decided(rules(SHIFT, tmp_path), now=TUESDAY_10 + hours * H).role == role


def test_summer_time_moves_the_hours(tmp_path: Path) -> None:
    shift = rules(SHIFT, tmp_path)
    july = datetime(2026, 7, 1, 5, 30, tzinfo=UTC).timestamp()  # 07:30 in Zurich
    assert decided(shift, now=july).role == "drive"
    december = datetime(2026, 12, 2, 5, 30, tzinfo=UTC).timestamp()  # 06:30
    assert decided(shift, now=december).role == "watch"


def test_a_night_belongs_to_the_day_on_which_it_begins(tmp_path: Path) -> None:
    night = rules(
        "time_zone: UTC\nrules: [{ name: night, role: drive, days: [fri], hours:"
        ' ["22:00-06:00"] }]\notherwise: none\n',
        tmp_path,
    )
    friday = datetime(2026, 12, 4, tzinfo=UTC).timestamp()
    for hour, role in ((5, None), (21.9, None), (22, "drive"), (29.9, "drive"), (30, None)):
        assert decided(night, now=friday + hour * H).role == role, hour
    assert decided(night, now=friday + 47 * H).role is None  # the night of Saturday


def test_the_first_rule_that_applies_decides(tmp_path: Path) -> None:
    """A refusal before a permission is final; guests have no name of their own."""
    shift = rules(SHIFT, tmp_path)
    eve = ANN._replace(name="Eve")
    assert decided(shift, eve).role is None
    assert decided(shift, eve._replace(is_guest=True)).role == "drive"


def test_a_refusal_names_the_rule_or_what_would_help(tmp_path: Path) -> None:
    shift = rules(SHIFT, tmp_path)
    assert decided(shift, ANN._replace(name="Eve")).reason == (
        "the rule “guests” of the site bern refuses Eve (zug)"
    )
    assert decided(shift, now=TUESDAY_10 + 9 * H).reason == (
        "no other rule applies, so the site bern lets Ann (zug) only watch; the rule “day shift”"
        " applies mon, tue, wed, thu, fri 07:00-12:00, 13:00-18:00 (Europe/Zurich)"
    )
    assert decided(shift, ANN._replace(place="192.168.1.7")).reason.endswith(
        "the rule “day shift” is for other networks"
    )
    assert decided(shift, proposed="watch", now=TUESDAY_10 + 9 * H).reason == ""


def test_without_a_file_the_role_is_the_proposed_one_but_at_most_drive(tmp_path: Path) -> None:
    assert read_rules(tmp_path / "rules.yaml") is OPEN
    for proposed in ROLES:
        role = "watch" if proposed == "watch" else "drive"
        assert decided(OPEN, proposed=proposed) == Decision(role)


def test_wrong_rules_refuse_everybody() -> None:
    found = decided(SiteRules(otherwise="drive", fault="rules.yaml:1:1: wrong"))
    assert found.role is None
    assert found.reason == "the rules of the site bern cannot be read, so it admits no visitors"


ROLE = st.sampled_from((None, "watch", "drive"))
RULE = st.builds(
    SiteRule,
    name=st.text(),
    role=ROLE,
    sites=st.frozensets(st.sampled_from(("zug", "thun"))),
    people=st.frozensets(st.sampled_from(("Ann", "Ben"))),
    days=st.frozensets(st.integers(0, 6)),
    hours=st.lists(st.builds(Hours, st.integers(0, 1439), st.integers(1, 1440))).map(tuple),
)


@given(
    st.builds(SiteRules, st.lists(RULE, max_size=4).map(tuple), ROLE),
    st.sampled_from(ROLES),
    st.floats(0, 4e9),
)
def test_nobody_gets_more_than_proposed_and_every_refusal_has_one_line(
    found: SiteRules, proposed: Role, now: float
) -> None:
    decision = found.decided(ANN, proposed, now, "bern")
    most: tuple[Role | None, ...] = (None, "watch") if proposed == "watch" else (None, *ROLES[:2])
    assert decision.role in most
    assert bool(decision.reason) == (decision.role != most[-1])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("otherwise: king\n", ":3:12: error "),
        ("rules: []\n", "'otherwise' is missing"),
        ("otherwise: watch\nopen: true\n", "'open'"),
        ("otherwise: watch\nrules: [{ name: a, role: drive, days: [mon] }]\n", "requires the key"),
        ("otherwise: watch\ntime_zone: Europe/Bern\n", "found 'Europe/Bern'"),
        ("otherwise: watch\ntime_zone: ../../etc/passwd\n", "expected the name of a time zone"),
        ("otherwise: watch\nrules: [{ name: a, role: drive, sites: [] }]\n", "sites"),
        (
            'otherwise: watch\nrules: [{ name: a, role: drive, networks: ["10.0.0.1/8"] }]\n',
            "expected an address or a network, found '10.0.0.1/8'",
        ),
        (
            'otherwise: watch\nrules: [{ name: a, role: drive, hours: ["7-18"] }]\n',
            "'7-18'",
        ),
        (
            "otherwise: watch\ntime_zone: UTC\n"
            'rules: [{ name: a, role: drive, hours: ["07:00-07:00"] }]\n',
            "expected an end that differs from the begin",
        ),
        (
            "otherwise: watch\nrules: [{ name: a, role: drive }, { name: a, role: none }]\n",
            "two rules have the name 'a'",
        ),
        ("otherwise: [\n", "error"),
    ],
)
def test_a_mistake_is_one_line_with_its_place(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ProblemsError) as caught:
        rules(text, tmp_path)
    (problem,) = caught.value.problems
    assert said in problem.headline
    assert problem.headline.startswith(f"{tmp_path / 'rules.yaml'}:")
    assert "\n" not in problem.headline
