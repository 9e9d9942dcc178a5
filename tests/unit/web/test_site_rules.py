"""Visitors lose a right as soon as the rules of the robot's site end it, and both sites record."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import Encoding

from tests.unit.fleet.fleets import Place
from urc.access.control import AccessControl
from urc.fleet.assertion import SCHEME, Assertion
from urc.fleet.membership import Membership
from urc.fleet.rules_file import RULES_FILE
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.server_recorder import ServerRecorder
from urc.testing.fleet_bus import FakeFleetNetwork
from urc.web.serve.access import Access
from urc.web.serve.site_peer import SitePeer, site_of
from urc.web.serve.visitor import Visitor
from urc.web.sites.member import Member
from urc.web.sites.robot_names import FarName
from urc.web.sites.site_network import SiteNetwork
from urc.web.sites.visit_log import VisitLog

NOON = datetime(2026, 12, 1, 12, tzinfo=UTC).timestamp()
SHIFT = """
time_zone: UTC
rules: [{ name: shift, role: drive, robots: ["#lab"], hours: ["08:00-12:01"] }]
otherwise: watch
"""
ANN = Assertion("p1", "Ann", "person", "s1", "cart", "drive", "10.0.0.7", "visit-1")


class Sites:
    """The office with a robot, its rules and its audit log; the hall with a visitor."""

    def __init__(self, folder: Path, rules: str = SHIFT) -> None:
        place = Place(folder)
        self.now = NOON
        self.office, self.hall = place.office, place.member()
        self.file = self.office.folder / RULES_FILE
        self.write(rules)
        self.network = self.network_of(self.office)
        self.access = Access(AccessControl(utc=lambda: self.now))
        self.access.tags_of = lambda robot: ("lab",) if robot == "cart" else ()
        self.entries: list[AuditEntry] = []
        self.network.attach(self.access, self.recorder(self.entries))
        self.from_hall = self.network_of(self.hall)

    def network_of(self, site: Membership) -> SiteNetwork:
        member = Member(site, lambda: datetime.fromtimestamp(self.now, UTC))
        return SiteNetwork(member, FakeFleetNetwork().bus(site.site), utc=lambda: self.now)

    def recorder(self, entries: list[AuditEntry]) -> ServerRecorder:
        return ServerRecorder(entries.append, utc=lambda: self.now, now=lambda: self.now)

    def write(self, rules: str) -> None:
        self.file.write_text(f"urc: 1\nkind: site-rules\n{rules}", encoding="utf-8")

    def reread(self) -> None:
        for _ in range(2):
            if self.network.rules.has_changed():
                self.network.rules.reread()
        self.network.judge_visits()

    def peer(self) -> SitePeer:
        return site_of(self.hall.certificate.certificate.public_bytes(Encoding.DER))

    def visit(self, assertion: Assertion = ANN) -> tuple[Visitor, str]:
        text = self.from_hall.asserted(assertion, "office")
        headers = [(b"authorization", f"{SCHEME} {text}".encode())]
        return self.access.visitor_from(self.peer(), headers, "/api/v1/robots/cart")


def test_a_visit_loses_its_right_when_the_hour_is_over(tmp_path: Path) -> None:
    sites = Sites(tmp_path)
    ann, refused = sites.visit()
    assert (refused, ann.role("cart"), ann.limit("cart")) == ("", "drive", "")
    told: list[str] = []
    sites.access.control.on_change.append(lambda: told.append(ann.limit("cart")))
    sites.now += 59.9
    sites.visit()
    sites.network.judge_visits()
    assert ann.role("cart") == "drive"
    told.clear()
    sites.now += 0.2
    sites.network.judge_visits()
    assert ann.role("cart") == "watch"
    assert told == [
        "no other rule applies, so the site office lets Ann (hall) only watch; the rule “shift”"
        " applies 08:00-12:01 (UTC)"
    ]


def test_a_changed_and_a_wrong_file_count_at_once(tmp_path: Path) -> None:
    sites = Sites(tmp_path)
    ann, _ = sites.visit()
    sites.write("otherwise: none\n")
    sites.reread()
    assert ann.role("cart") is None
    assert ann.limit("cart") == "no other rule applies, so the site office refuses Ann (hall)"
    sites.write("otherwise: drive\n")
    sites.reread()
    assert ann.role("cart") == "drive"
    sites.write("otherwise: driving\n")
    sites.reread()
    assert ann.role("cart") is None
    stranger, refused = sites.visit()
    assert not stranger.is_known
    assert refused == "the rules of the site office cannot be read, so it admits no visitors"


def test_the_newest_assertion_decides_also_if_it_is_refused(tmp_path: Path) -> None:
    """A device that has moved to a refused network keeps nothing."""
    rule = "{ name: inside, role: drive, networks: [10.0.0.0/8] }"
    sites = Sites(tmp_path, f"rules: [{rule}]\notherwise: none\n")
    ann, _ = sites.visit()
    assert ann.role("cart") == "drive"
    _, refused = sites.visit(replace(ANN, place="192.168.1.7"))
    assert refused.endswith("the rule “inside” is for other networks")
    assert ann.role("cart") is None


def test_each_change_of_a_visit_is_recorded_once_under_its_identifier(tmp_path: Path) -> None:
    sites = Sites(tmp_path)
    for _ in range(3):
        sites.visit()
    sites.now += 61
    sites.network.judge_visits()
    found = [(one.what, one.robot, one.client, one.role, one.who) for one in sites.entries]
    assert found == [
        ("visit", "cart", "visit-1", "drive", "Ann (hall)"),
        ("visit", "cart", "visit-1", "watch", "Ann (hall)"),
    ]
    assert sites.entries[0].outcome == "admitted"
    assert "the rule “shift” applies" in sites.entries[1].outcome
    assert sites.entries[0].place == "10.0.0.7"


def test_the_visitors_site_records_the_same_identifier(tmp_path: Path) -> None:
    sites = Sites(tmp_path)
    entries: list[AuditEntry] = []
    log = VisitLog(lambda: sites.now)
    log.recorder = sites.recorder(entries)
    far = FarName("cart", "office")
    visit = log.sent(ANN, far, "passkey")
    sites.now += 20
    assert log.sent(ANN, far, "passkey") == visit
    sites.now += 31
    other = log.sent(ANN, far, "passkey")
    assert other != visit
    found = [(one.what, one.robot, one.client, one.who, one.way) for one in entries]
    assert found == [
        ("visit", "cart@office", visit, "Ann", "passkey"),
        ("visit", "cart@office", other, "Ann", "passkey"),
    ]
    sites.visit(replace(ANN, visit=other))
    (seen,) = (one.client for one in sites.entries)
    assert seen == other


@pytest.mark.parametrize("visit", ["a b", "x" * 65])
def test_an_assertion_with_a_wrong_identifier_is_refused(tmp_path: Path, visit: str) -> None:
    """It becomes part of the audit log."""
    sites = Sites(tmp_path)
    _, refused = sites.visit(replace(ANN, visit=visit))
    assert refused == "the assertion has no valid 'visit'"
