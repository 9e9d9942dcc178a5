"""A robot that answers frames of motion: what it takes is no stray frame, what it refuses ends."""

from pathlib import Path

from tests.dialogue import Dialogue
from urc.config.load import check
from urc.model.payload import Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, MotionRefused, Samples, Violation
from urc.runtime.registries import built_in_catalog

DRIVER = """
signals:
  mode: { type: string }
  speed: { type: number }
commands:
  drive:
    send: "V {{ v }}"
    args: { v: { type: number, default: 0 } }
    reply:
      regex: '^OK( (?P<speed>\\d+))?$'
      errors: ['^ERR', { regex: '^NAK (?P<_why>.+)$', text: "it says {{ _why }}" }]
    hold: { repeat: 50ms, release: {}, watchdog: 500ms }
  lift:
    send: "L {{ v }}"
    args: { v: { type: number, default: 0 } }
    reply:
      regex: '^L(?P<_v>\\d+) OK$'
      match: _v == v
      errors: [{ regex: '^L(?P<_v>\\d+) NO$', text: lift is locked }]
    hold: { repeat: 50ms, release: {}, watchdog: 500ms }
  ask: { send: ASK, reply: { equals: YES, errors: ['^ERR'] } }
messages:
  mode: { regex: '^MODE (?P<mode>\\w+)$' }
"""


def refusals(events: list[Event]) -> list[tuple[str, str]]:
    return [(one.command, one.why) for one in events if isinstance(one, MotionRefused)]


class Held(Dialogue):
    """A talk with a robot that is driven."""

    def __init__(self) -> None:
        super().__init__(DRIVER)
        self.refused: list[tuple[str, str]] = []
        self.connect()

    def give(self, command: str = "drive", v: float = 1) -> None:
        """Take a frame of motion from the engine, which somebody else writes."""
        self.engine.motions.motion_frame(command, {"v": v}, self.now)

    def hear(self, text: str) -> list[object]:
        """Let the robot say something; return faults and readings."""
        events = self.engine.receive("wire", text.encode(), self.now)
        self.refused += refusals(events)
        others = (one for one in events if not isinstance(one, MotionRefused))
        return [one.code if isinstance(one, Violation) else one for one in others]


def test_an_acknowledgement_is_no_stray_frame_and_sets_its_signals() -> None:
    """Twenty a second would fill the log with faults of a robot that is well."""
    talk = Held()
    assert talk.hear("OK 3\n") == ["no-match"]
    talk.give()
    (told,) = talk.hear("OK 3\n")
    assert isinstance(told, Samples)
    assert [(one.signal, one.value) for one in told.samples] == [("speed", 3.0)]
    assert talk.hear("OK\n") == [Samples("wire", ())]
    assert talk.refused == []


def test_a_refusal_is_told_in_the_words_of_the_robot() -> None:
    """It is counted as well."""
    talk = Held()
    talk.give()
    assert talk.hear("ERR 7\n") == ["motion-refused"]
    assert talk.refused == [("drive", "the robot answered 'ERR 7'")]
    assert talk.hear("NAK the guard is open\n")[-1] == "motion-refused"
    assert talk.refused[1:] == [("drive", "it says the guard is open")]


def test_a_refusal_that_answers_nothing_ends_motion_too() -> None:
    """A guard that is opened two frames later is as good a reason."""
    talk = Held()
    talk.give()
    talk.hear("OK\nOK\nMODE auto\nNAK the guard is open\n")
    assert talk.refused == [("drive", "it says the guard is open")]


def test_messages_are_told_between_acknowledgements() -> None:
    """The robot goes on talking while it is driven."""
    talk = Held()
    talk.give()
    first, second = talk.hear("MODE auto\nOK\n")
    assert [one.signal for one in first.samples] == ["mode"]  # type: ignore[attr-defined]
    assert second == Samples("wire", ())


def test_an_answer_that_comes_later_than_any_answer_may_is_a_stray_one() -> None:
    """And a robot at rest refuses nothing."""
    talk = Held()
    talk.give()
    talk.now = 0.6
    assert talk.hear("ERR 7\n") == ["no-match"]
    assert talk.refused == []


def test_an_answer_of_the_last_connection_is_none_of_this_one() -> None:
    """What was given before the cut is over."""
    talk = Held()
    talk.give()
    talk.engine.closed("wire", "gone", 0.1)
    talk.connect()
    assert talk.hear("ERR 7\n") == ["no-match"]
    assert talk.refused == []


def test_a_request_that_waits_has_its_own_answer_first() -> None:
    """Its refusal is not that of the motion beside it."""
    talk = Held()
    talk.give()
    talk.run("ask")
    talk.hear("ERR busy\n")
    assert talk.refused == []


def test_what_names_one_of_two_motions_refuses_that_one() -> None:
    """What names none refuses all that it may be about."""
    talk = Held()
    talk.give()
    talk.give("lift", 4)
    talk.hear("L4 NO\n")
    assert talk.refused == [("lift", "lift is locked")]
    talk.hear("L5 NO\n")
    assert len(talk.refused) == 1


WEB = """
urc: 1
kind: driver
name: web
transports:
  web: { type: http, url: "http://127.0.0.1:80" }
commands:
  drive:
    send: { request: { method: POST, path: /drive, json: { v: "{{ v }}" } } }
    args: { v: { type: number, default: 0 } }
    hold: { repeat: 100ms, release: {}, watchdog: 500ms }
polls:
  - { every: 1s, send: { request: { path: /state } } }
"""


def test_a_response_with_a_refusal_is_told_in_the_words_of_the_server(tmp_path: Path) -> None:
    """Motion by requests has no number of its own: its answer carries none."""
    file = tmp_path / "web.yaml"
    file.write_text(WEB, "utf-8")
    profile = check(file, built_in_catalog()).profile
    assert profile is not None
    engine = Engine(profile.driver, {})
    engine.tick(0)
    engine.start("web", 0)
    engine.motions.motion_frame("drive", {"v": 1}, 0)
    good = Envelope("response", {"id": None, "ok": True}, b"")
    assert refusals(engine.receive("web", good, 0.1)) == []
    bad = Envelope("response", {"id": None, "ok": False, "reason": "409 Conflict"}, b"")
    assert refusals(engine.receive("web", bad, 0.1)) == [("drive", "409 Conflict")]
