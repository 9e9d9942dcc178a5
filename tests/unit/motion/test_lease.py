"""One robot, one driver."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from tests.effort import examples
from urc.model.role import Role
from urc.motion.lease import Lease, LeaseChanged, LeaseRefused, LeaseState, Operator

ANNA = Operator("a", "Anna")
BERT = Operator("b", "Bert")
CARL = Operator("c", "Carl", role="maintain")
EVE = Operator("e", "Eve", role="watch")


def test_whoever_comes_first_drives_and_the_others_are_told_who() -> None:
    lease = Lease()
    taken = lease.acquire(ANNA, 0.0)
    assert isinstance(taken, LeaseChanged)
    assert taken.must_stop
    assert lease.acquire(BERT, 0.0) == LeaseRefused("Anna has the controls")
    assert lease.refusal("a", taken.state.epoch) == ""
    assert lease.refusal("b", taken.state.epoch) == "Anna has the controls"


def test_a_driver_without_a_name_is_somebody() -> None:
    lease = Lease()
    lease.acquire(Operator("a"), 0.0)
    assert lease.acquire(BERT, 1.0) == LeaseRefused("somebody else has the controls")


def test_an_input_of_an_earlier_lease_is_refused() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    before = lease.state.epoch
    lease.leave("a")
    lease.acquire(ANNA, 1.0)
    assert lease.refusal("a", before) == "Control changed hands meanwhile"


def test_a_request_without_an_answer_is_granted_when_its_time_is_over() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.request(BERT, 1.0)
    assert lease.deadline == 11.0
    assert lease.expire(10.9) is None
    given = lease.expire(11.0)
    assert given is not None
    assert given.must_stop
    assert given.state.holder == BERT


def test_the_holder_may_keep_the_controls() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.request(BERT, 1.0)
    lease.touch(1.0)
    kept = lease.answer("a", 2.0, is_granted=False)
    assert isinstance(kept, LeaseChanged)
    assert not kept.must_stop
    assert lease.expire(11.0) is None
    assert lease.state.holder == ANNA


def test_a_request_that_was_declined_leaves_no_trace() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    before = lease.state
    asked = before._replace(asked_by=BERT, asked_until=11.0)
    assert lease.request(BERT, 1.0) == LeaseChanged(asked, must_stop=False)
    assert lease.answer("a", 2.0, is_granted=False) == LeaseChanged(before, must_stop=False)


def test_only_the_holder_answers_a_request() -> None:
    """Nobody gives the controls to themselves."""
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.request(BERT, 1.0)
    for who in ("b", "c"):
        for is_granted in (True, False):
            answered = lease.answer(who, 2.0, is_granted=is_granted)
            assert answered == LeaseRefused("No screen is asking you for control")
    assert (lease.state.holder, lease.state.asked_by) == (ANNA, BERT)
    lease.answer("a", 2.0, is_granted=False)
    late = lease.answer("a", 3.0, is_granted=True)
    assert late == LeaseRefused("No screen is asking you for control")


def test_one_asks_at_a_time_and_may_ask_again() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.request(BERT, 1.0)
    assert lease.request(CARL, 2.0) == LeaseRefused("Bert has already asked for control")
    assert lease.request(EVE, 2.0) == LeaseRefused("watchers cannot drive")
    again = lease.request(BERT, 3.0)
    assert isinstance(again, LeaseChanged)
    assert (again.state.asked_by, again.state.asked_until) == (BERT, 13.0)


def test_a_request_lasts_3_to_60_seconds() -> None:
    for asked_s, waits_s in ((0.1, 3.0), (20.0, 20.0), (1e9, 60.0)):
        lease = Lease()
        lease.acquire(ANNA, 0.0)
        lease.request(BERT, 0.0, asked_s)
        assert lease.state.asked_until == waits_s


def test_only_an_engineer_takes_the_controls_by_force() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    assert isinstance(lease.force(BERT, 1.0), LeaseRefused)
    taken = lease.force(CARL, 1.0)
    assert isinstance(taken, LeaseChanged)
    assert taken.must_stop
    assert taken.state.holder == CARL


def test_a_viewer_stops_the_robot_and_cannot_drive_or_reset_it() -> None:
    lease = Lease()
    assert isinstance(lease.acquire(EVE, 0.0), LeaseRefused)
    assert lease.stop(EVE.name).must_stop
    assert isinstance(lease.reset(EVE), LeaseRefused)


def test_stop_latches_until_somebody_resets_it_on_purpose() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.stop("Eve")
    assert lease.acquire(ANNA, 1.0) == LeaseRefused("Stopped by Eve. Reset to drive again.")
    assert lease.force(CARL, 1.0) == LeaseRefused("Stopped by Eve. Reset to drive again.")
    reset = lease.reset(ANNA)
    assert isinstance(reset, LeaseChanged)
    assert reset.state.holder is None
    assert isinstance(lease.acquire(ANNA, 2.0), LeaseChanged)


def test_a_stop_stays_that_of_the_first_who_pressed_it() -> None:
    """Who saw the danger can say when it is over; a second press changes no name."""
    lease = Lease()
    lease.stop("Eve")
    again = lease.stop("Bert")
    assert again.must_stop
    assert again.state.latched_by == "Eve"
    assert again.state.stops == 2
    lease.reset(ANNA)
    assert lease.stop("Bert").state.latched_by == "Bert"


def test_what_was_wished_before_a_stop_is_refused_also_when_it_was_reset() -> None:
    """By whoever; what is wished after it is not."""
    lease = Lease()
    before = lease.state.stops
    assert lease.interlock(ANNA, before) == ""
    lease.stop("ben")
    lease.reset(ANNA)
    lease.acquire(ANNA, 1.0)
    assert lease.interlock(ANNA, before) == "STOP was pressed meanwhile: send it again"
    assert lease.interlock(ANNA, lease.state.stops) == ""
    assert lease.interlock(ANNA) == ""


def test_a_latch_survives_a_restart_and_a_holder_does_not() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    again = Lease(lease.state)
    assert again.state.holder is None
    assert again.state.epoch > lease.state.epoch
    lease.stop("Eve")
    assert Lease(lease.state).refusal("a", 0) == "Stopped by Eve. Reset to drive again."


def test_a_holder_who_goes_silent_gives_the_controls_back() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    lease.touch(30.0)
    assert lease.expire(89.9) is None
    left = lease.expire(90.0)
    assert left is not None
    assert left.must_stop
    assert left.state.holder is None


def test_a_request_goes_with_the_client_that_made_it() -> None:
    """Other clients change nothing when they go."""
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    before = lease.state
    lease.request(BERT, 1.0)
    assert lease.leave("c") is None
    assert lease.state.asked_by == BERT
    assert lease.leave("b") == LeaseChanged(before, must_stop=False)
    assert lease.state == before


def test_a_holder_without_a_request_has_a_minute() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    assert lease.deadline == 60.0


def test_returned_controls_are_free() -> None:
    lease = Lease()
    lease.acquire(ANNA, 0.0)
    left = lease.leave("a")
    assert left == LeaseChanged(LeaseState(lease.state.epoch), must_stop=True)


def test_only_a_stop_can_be_reset_and_a_reset_stops_nothing() -> None:
    lease = Lease()
    assert lease.latched == ""
    assert lease.reset(ANNA) == LeaseRefused("nothing is stopped")
    lease.stop("Eve")
    assert lease.latched == "Stopped by Eve. Reset to drive again."
    assert lease.reset(ANNA) == LeaseChanged(lease.state, must_stop=False)
    assert lease.latched == ""


def test_the_count_of_stops_goes_on_in_the_next_lease() -> None:
    assert Lease(LeaseState(7, stops=3)).state == LeaseState(8, stops=3)


ROLES: list[Role] = ["watch", "drive", "maintain", "administer"]


class ThreeClients(RuleBasedStateMachine):
    """Three clients do whatever they like; the wire must never have two holders."""

    def __init__(self) -> None:
        super().__init__()
        self.lease = Lease()
        self.now = 0.0
        self.on_wire: tuple[str, int] | None = None
        """Whose motion the robot obeys, as of the last change that began with a stop."""

    def note(self, outcome: LeaseChanged | LeaseRefused | None) -> None:
        if not isinstance(outcome, LeaseChanged):
            return
        holder = outcome.state.holder
        now = None if holder is None else (holder.id, outcome.state.epoch)
        if not outcome.must_stop:
            assert now == self.on_wire, "the holder changed without a stop"
        self.on_wire = now

    @rule(who=st.integers(0, 2), role=st.sampled_from(ROLES), wait=st.floats(0.0, 30.0),
          verb=st.sampled_from(["take", "ask", "force", "leave", "stop", "reset", "yes", "no",
                                "wait", "touch", "restart"]))  # fmt: skip
    def step(self, who: int, role: Role, wait: float, verb: str) -> None:
        client, lease = Operator(f"c{who}", f"C{who}", role), self.lease
        self.now += wait
        match verb:
            case "take":
                self.note(lease.acquire(client, self.now))
            case "ask":
                self.note(lease.request(client, self.now, wait))
            case "force":
                self.note(lease.force(client, self.now))
            case "leave":
                self.note(lease.leave(client.id))
            case "stop":
                self.note(lease.stop(client.name))
            case "reset":
                self.note(lease.reset(client))
            case "yes" | "no":
                self.note(lease.answer(client.id, self.now, is_granted=verb == "yes"))
            case "wait":
                self.note(lease.expire(self.now))
            case "touch":
                lease.touch(self.now)
            case "restart":
                self.lease = Lease(lease.state)
                self.on_wire = None

    @invariant()
    def only_the_holder_moves_the_robot(self) -> None:
        state: LeaseState = self.lease.state
        allowed = [
            (client, epoch)
            for client in ("c0", "c1", "c2")
            for epoch in range(max(0, state.epoch - 3), state.epoch + 2)
            if not self.lease.refusal(client, epoch)
        ]
        assert len(allowed) <= 1
        assert allowed in ([], [self.on_wire])


ThreeClients.TestCase.settings = settings(
    max_examples=examples(200), stateful_step_count=50, deadline=None
)
TestThreeClients = ThreeClients.TestCase


def test_reset_that_was_sent_before_a_newer_stop_does_not_undo_it() -> None:
    lease = Lease()
    lease.stop("ann")
    seen = lease.state.stops
    lease.stop("bob")
    refused = lease.reset(Operator("ann", "ann", "drive"), seen)
    assert refused == LeaseRefused("STOP was pressed again: reset it again")
    assert lease.state.latched_by == "ann"
    assert isinstance(lease.reset(Operator("ann", "ann", "drive"), seen + 1), LeaseChanged)


def test_reset_from_another_site_names_the_stops_that_it_undoes() -> None:
    """It may have been on its way for a while, so it never undoes what its sender did not see."""
    lease = Lease()
    lease.stop("ann")
    far = Operator("far", "far", "drive", way="site")
    refused = lease.reset(far)
    assert refused == LeaseRefused("A reset from another site must contain the number of STOPs")
    assert lease.state.latched_by == "ann"
    assert isinstance(lease.reset(far, lease.state.stops), LeaseChanged)
