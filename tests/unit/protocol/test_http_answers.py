"""The answers of a web server: what refuses, what stands in their head, and where to ask next."""

from pathlib import Path

import pytest

from urc.client.local import load
from urc.model.payload import Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Replied, Request, Samples, Send

DOCUMENT = """
urc: 1
kind: robot
name: plotter

transports:
  web:
    type: http
    url: "http://127.0.0.1:8080/api"
    errors:
      - { raw: _body, head: { _code: status }, when: _code == 423, text: Somebody else has it }

signals:
  fault: { type: string }
  jobs: { type: integer }

commands:
  draw:
    send: { request: { method: POST, path: /jobs } }
    reply:
      raw: _body
      head: { _next: Location, _code: status, jobs: X-Jobs }
      errors:
        - { json: { fault: error.name }, text: "It says {{ fault }}" }
        - '^paper'
  look: { send: { request: { path: /look } }, reply: { raw: _body } }

sequences:
  whole:
    - { send: { request: { method: POST, path: /jobs } } }
    - { expect: { raw: _body, head: { _job: Location }, errors: ['^paper'] } }
    - { send: { request: { url: "{{ _job }}" } } }
    - { expect: { json: { jobs: left } } }
  shorter:
    - { run: draw }
    - { send: { request: { url: "{{ _next }}" } } }
"""


class Talk:
    """An engine whose web server is the test."""

    def __init__(self, folder: Path) -> None:
        (folder / "plotter.yaml").write_text(DOCUMENT)
        self.engine = Engine(load(folder / "plotter.yaml").driver, {})
        self.requests: list[Envelope] = []
        self.values: dict[str, object] = {}
        self.outcome: Replied | Failed | None = None
        self.take(self.engine.tick(0.0))
        self.take(self.engine.start("web", 0.0))

    def run(self, command: str) -> None:
        self.take(self.engine.command(Request(1, command), 0.0))

    def answer(self, status: int, body: bytes = b"", **headers: str) -> None:
        """Answer the newest request as the transport does."""
        attributes: dict[str, object] = {
            "id": self.requests[-1].attributes["id"],
            "ok": status < 300,
            "status": status,
            "headers": {name.replace("_", "-"): value for name, value in headers.items()},
        }
        if status >= 300:
            attributes["reason"] = f"{status} Some Reason"
        self.take(self.engine.receive("web", Envelope("response", attributes, body), 0.0))

    def take(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, Send):
                assert isinstance(event.data, Envelope)
                self.requests.append(event.data)
            elif isinstance(event, Samples):
                self.values |= {one.signal: one.value for one in event.samples}
            elif isinstance(event, Replied | Failed):
                self.outcome = event


@pytest.fixture
def talk(tmp_path: Path) -> Talk:
    return Talk(tmp_path)


@pytest.mark.parametrize(
    ("status", "body", "said"),
    [
        (409, b'{"error": {"name": "pen up"}}', "It says pen up"),
        (503, b"paper jam", "the robot answered 'paper jam'"),
        (423, b"", "Somebody else has it"),
        (500, b"oh", "500 Some Reason"),
        (404, b"\xff\xfe", "404 Some Reason"),
    ],
)
def test_a_bad_answer_is_read_as_the_driver_says(
    talk: Talk, status: int, body: bytes, said: str
) -> None:
    """By the errors of the reply and of the line; the status is told where none of them fits."""
    talk.run("draw")
    talk.answer(status, body)
    assert isinstance(talk.outcome, Failed)
    assert (talk.outcome.code, talk.outcome.message) == ("refused", said)
    assert talk.values == ({"fault": "pen up"} if status == 409 else {})


def test_the_head_of_an_answer_has_fields(talk: Talk) -> None:
    """Status and headers, whatever the case of their names; one that is not there is none."""
    talk.run("draw")
    talk.answer(201, b"{}", location="/api/jobs/7", X_Jobs="3")
    assert isinstance(talk.outcome, Replied)
    assert talk.outcome.values == {"body": b"{}", "next": "/api/jobs/7", "code": 201, "jobs": 3}
    talk.run("draw")
    talk.answer(200, b"{}")
    assert talk.outcome.values == {"body": b"{}", "code": 200}


@pytest.mark.parametrize("command", ["draw", "look"])
def test_a_redirect_is_an_answer_to_those_who_read_where_it_leads(talk: Talk, command: str) -> None:
    """To all others it is a failure, as nothing follows it by itself."""
    talk.run(command)
    talk.answer(303, b"", location="/api/jobs/8")
    assert type(talk.outcome) is (Replied if command == "draw" else Failed)


def test_a_sequence_expects_the_answer_to_its_request_and_follows_it(talk: Talk) -> None:
    """The robot says where; the request names that URL, and no path below the document's."""
    talk.run("whole")
    talk.answer(202, b"", location="/api/jobs/9")
    assert talk.requests[-1].attributes["url"] == "/api/jobs/9"
    assert "path" not in talk.requests[-1].attributes
    talk.answer(200, b'{"left": 4}')
    assert isinstance(talk.outcome, Replied)
    assert talk.values == {"jobs": 4}


@pytest.mark.parametrize(
    ("status", "body", "said"),
    [
        (503, b"paper", "the robot answered 'paper'"),
        (404, b"x", "404 Some Reason"),
    ],
)
def test_a_sequence_ends_with_a_bad_answer(talk: Talk, status: int, body: bytes, said: str) -> None:
    """In the words of the step, or of the server."""
    talk.run("whole")
    talk.answer(status, body)
    assert isinstance(talk.outcome, Failed)
    assert talk.outcome.message == said


def test_a_sequence_ends_with_an_answer_of_another_form(talk: Talk) -> None:
    """No other answer to that request will come."""
    talk.run("whole")
    talk.answer(202, b"", location="/api/jobs/9")
    talk.answer(200, b"no json")
    assert isinstance(talk.outcome, Failed)
    assert talk.outcome.message == "the reply does not match the declaration: 'no json'"


def test_the_answer_to_a_request_that_nobody_expects_is_dropped(talk: Talk) -> None:
    """It is not taken for the answer that a later step expects."""
    talk.run("shorter")
    talk.answer(201, b"", location="/api/jobs/9")
    assert isinstance(talk.outcome, Replied)
    assert talk.requests[-1].attributes["url"] == "/api/jobs/9"
    talk.answer(500, b"paper")
    talk.run("whole")
    talk.answer(202, b"", location="/j")
    assert talk.requests[-1].attributes["url"] == "/j"
