"""Visitors from other sites have their role as long as their site renews it."""

from urc.access.control import AccessControl
from urc.access.visits import MAX_VISITS, Visit, Visits

ANN = Visit("zug", "p1", "Ann", "person", "s1", "cart", "drive")
LASTS_S = 30.0


class Clock:
    """UTC time."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_a_visitor_has_the_role_for_the_named_robot_until_it_ends() -> None:
    """Other robots are not part of the visit."""
    clock = Clock()
    control = AccessControl(utc=clock)
    ann = control.visit(ANN, LASTS_S)
    assert (ann.name, ann.way, ann.kind) == ("Ann (zug)", "site", "person")
    assert control.role(ann, "cart") == "drive"
    assert control.role(ann, "crane") is None
    assert control.role(ann) is None
    clock.now += LASTS_S
    assert control.role(ann, "cart") is None


def test_a_renewal_prolongs_and_a_lower_role_counts_at_once() -> None:
    """The newest assertion decides."""
    clock = Clock()
    control = AccessControl(utc=clock)
    ann = control.visit(ANN, LASTS_S)
    clock.now += 20
    assert control.visit(ANN._replace(role="watch"), LASTS_S) == ann
    clock.now += 20
    assert control.role(ann, "cart") == "watch"


def test_a_visitor_may_use_several_robots() -> None:
    """Each robot has a role of its own."""
    control = AccessControl(utc=Clock())
    ann = control.visit(ANN, LASTS_S)
    control.visit(ANN._replace(robot="crane", role="watch"), LASTS_S)
    assert (control.role(ann, "cart"), control.role(ann, "crane")) == ("drive", "watch")


def test_the_visits_of_a_revoked_site_end_and_others_stay() -> None:
    """The callbacks that close sockets run."""
    control = AccessControl(utc=Clock())
    ann = control.visit(ANN, LASTS_S)
    bob = control.visit(ANN._replace(site="thun"), LASTS_S)
    told: list[bool] = []
    control.on_change.append(lambda: told.append(True))
    control.end_visits("zug")
    assert control.role(ann, "cart") is None
    assert control.role(bob, "cart") == "drive"
    assert told == [True]


def test_no_secret_opens_a_visit() -> None:
    """A browser cannot become a visitor by its identifier."""
    control = AccessControl(utc=Clock())
    ann = control.visit(ANN, LASTS_S)
    assert control.identify(ann.sign_in).principal == ""


def test_visits_end_and_are_bounded() -> None:
    """Ended roles go first; above the limit, the oldest visit ends."""
    visits = Visits()
    for number in range(MAX_VISITS + 1):
        visits.renew(ANN._replace(sign_in=f"s{number}"), 0.0, 30.0)
    assert len(visits.sign_ins) == MAX_VISITS
    assert "zug/s0" not in visits.sign_ins
    visits.renew(ANN._replace(sign_in="s9", robot="crane"), 10.0, 60.0)
    assert visits.end(30.0)
    assert list(visits.sign_ins) == ["zug/s9"]
    assert not visits.end(40.0)


def test_a_judgement_lowers_a_role_at_once_and_says_why() -> None:
    """The robot's site may change its rules while somebody drives."""
    control = AccessControl(utc=Clock())
    ann = control.visit(ANN, LASTS_S)
    control.visit(ANN._replace(robot="crane"), LASTS_S)
    told: list[bool] = []
    control.on_change.append(lambda: told.append(True))

    def decide(visit: Visit) -> Visit:
        if visit.robot == "crane":
            return visit
        return visit._replace(role=None, limit="the day is over")

    (changed,) = control.judge_visits(decide)
    assert (changed.robot, changed.role) == ("cart", None)
    assert (control.role(ann, "cart"), control.role(ann, "crane")) == (None, "drive")
    assert control.visit_limit(ann, "cart") == "the day is over"
    assert control.visit_limit(ann, "crane") == ""
    assert told == [True]
    assert control.judge_visits(decide) == []
    assert told == [True]
