"""Tests of documents that go step by step: what passes, and what is told at which step."""

from pathlib import Path

import pytest

from urc.config.load import check
from urc.problems import to_text
from urc.runtime.coverage import measure
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog

DRIVER = r"""
urc: 1
kind: robot
name: crane
settings: { user: { type: string, default: bob } }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 1
    framing: { type: delimiter, tx: LF, rx: LF }
    queue: { in_flight: 2 }
    timeouts: { reply: 1s }
    on_connect: [{ expect: '^Login:$' }, { send: "{{ settings.user }}" }, { expect: '^Welcome$' }]
    on_close: [{ send: bye }]
  once:
    type: tcp
    host: 127.0.0.1
    port: 2
    connection: per_request
    framing: { type: delimiter, tx: LF, rx: LF }
  quiet: { type: tcp, host: 127.0.0.1, port: 3, framing: { type: idle, gap: 20ms } }
signals:
  load: { type: integer, limits: { high: 400, for: 2s }, stale_after: 3s }
  hook: { type: string, stale_after: 60s }
  tone: { type: integer, stale_after: 60s }
messages:
  hook: { from: wire, regex: '^HOOK (?P<hook>\w)$' }
  tone: { from: quiet, struct: [u8 tone] }
commands:
  lift:
    to: wire
    send: "LIFT {{ by }}"
    args: { by: { type: integer, max: 9 } }
    reply: { stages: [{ equals: ACK }, { regex: '^DONE (?P<_at>\d+)$', timeout: 5s }] }
    requires: [{ expr: "hook == 'U'", else: The hook is down }]
  ask: { to: once, send: ASK, reply: { regex: '^A (?P<load>\d+)$', errors: ['^ERR'] } }
polls:
  - { name: load, to: wire, every: 1s, send: "LOAD?", reply: { regex: '^LOAD (?P<load>\d+)$' } }
  - { name: beat, to: quiet, every: 1s, send: x }
tests:
  - name: it
"""


def outcome(tmp_path: Path, test: str) -> tuple[list[str], set[str]]:
    """Run one test; return what is told, and what of the driver it used."""
    file = tmp_path / "crane.yaml"
    file.write_text(DRIVER + "".join(f"    {line}\n" for line in test.strip().splitlines()))
    checked = check(file, built_in_catalog())
    errors = [to_text(one) for one in checked.problems if one.severity == "error"]
    assert errors == []
    assert checked.profile is not None
    found = exercise(checked.profile)
    untested = measure("", checked.profile.driver, found.exercised).untested
    names = {"lift", "ask", "load", "hook", "tone"} - {name for _, name in untested}
    return [
        f"{one.line - DRIVER.count(chr(10))}:{one.column} "
        + one.message.removeprefix("test 'it', step ")
        for one in found.problems
    ], names


PASSES = {
    "a login before anything else": (
        """
        polls: [load]
        steps:
          - { sent: { wire: [] }, expect: { load: { age: never } } }
          - { feed: { wire: "Login:\\n" }, sent: { wire: bob } }
          - { feed: { wire: "Welcome\\n" }, sent: { wire: "LOAD?" } }
          - { wait: 400ms, sent: { wire: [] } }
          - { feed: { wire: "LOAD 7\\n" }, expect: { load: 7 } }
          - { wait: 600ms, sent: { wire: { hex: 4C 4F 41 44 3F 0A } } }
        """,
        {"load"},
    ),
    "the settings of a test": (
        """
        settings: { user: eve }
        steps: [{ feed: { wire: "Login:\\n" }, sent: { wire: eve } }]
        """,
        set(),
    ),
    "an alarm after its time, and a value that grows old": (
        """
        ready: true
        polls: [load]
        steps:
          - { feed: { wire: "LOAD 500\\n" }, expect: { load: { value: 500, alarm: none } } }
          - { wait: 900ms }
          - { wait: 1200ms, fails: reply-timeout, expect: { load: { alarm: high, age: fresh } } }
          - { wait: 1s, expect: { load: { value: 500, age: stale } } }
        """,
        {"load"},
    ),
    "an answer in stages, with a message in between": (
        """
        ready: true
        steps:
          - { feed: { wire: "HOOK U\\n" } }
          - { run: lift, args: { by: 2 }, sent: { wire: LIFT 2 } }
          - { feed: { wire: ["ACK\\n", "HOOK D\\n"] }, expect: { hook: D } }
          - { wait: 4s }
          - { feed: { wire: "DONE 12\\n" }, reply: { at: "12" }, of: lift }
        """,
        {"lift", "hook"},
    ),
    "two at work, of which the later one ends first": (
        """
        ready: true
        steps:
          - { feed: { wire: "HOOK U\\n" } }
          - { run: lift, args: { by: 2 } }
          - { run: ask, sent: { once: ASK, wire: LIFT 2 } }
          - { feed: { once: "A 5\\n" }, reply: { load: 5 }, of: ask }
          - { feed: { wire: ["ACK\\n", "DONE 1\\n"] } }
          - { reply: {} }
        """,
        {"lift", "ask", "hook"},
    ),
    "failures, each where it comes": (
        """
        ready: true
        steps:
          - { run: lift, args: { by: 2 }, sent: { wire: [] }, fails: The hook is down }
          - { feed: { wire: "HOOK U\\n" } }
          - { run: lift, args: { by: 20 }, fails: "bad-argument: by" }
          - { run: lift, args: { by: 2 } }
          - { feed: { wire: "ACK\\n" } }
          - { wait: 5s, fails: timed-out, of: lift }
          - { run: ask }
          - { feed: { once: "ERR\\n" }, fails: refused }
        """,
        {"lift", "ask", "hook"},
    ),
    "a line that goes, comes back, and is left": (
        """
        steps:
          - { feed: { wire: ["Login:\\n", "Welcome\\n"] }, sent: { wire: bob } }
          - { feed: { wire: "HOOK U\\n" } }
          - { run: lift, args: { by: 1 }, sent: { wire: LIFT 1 } }
          - { closes: wire, fails: disconnected }
          - { connects: wire }
          - { feed: { wire: ["Login:\\n", "Welcome\\n"] }, sent: { wire: [bob] } }
          - { leaves: true, sent: { wire: bye }, closed: wire }
        """,
        {"lift", "hook"},
    ),
    "a frame that silence ends": (
        """
        steps:
          - { feed: { quiet: { hex: "07" } }, expect: { tone: { age: never } } }
          - { wait: 20ms, expect: { tone: 7 } }
        """,
        {"tone"},
    ),
    "a login that is refused closes the line": (
        """
        steps:
          - { feed: { wire: "Login:\\n" } }
          - { wait: 2s, fails: did not arrive within 1 s, closed: wire }
        """,
        set(),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PASSES)
def test_dialogue_that_holds_passes(name: str, tmp_path: Path) -> None:
    """And what it touches is counted as exercised, nothing else."""
    test, used = PASSES[name]
    assert outcome(tmp_path, cleandoc(test)) == ([], used)


def cleandoc(text: str) -> str:
    lines = text.strip("\n").splitlines()
    indent = len(lines[0]) - len(lines[0].lstrip())
    return "\n".join(line[indent:] for line in lines)


def steps(*lines: str, ready: bool = True) -> str:
    head = ["ready: true"] if ready else []
    return "\n".join([*head, "steps:", *(f"  - {{ {line} }}" for line in lines)])


@pytest.mark.parametrize(
    ("test", "told"),
    [
        (
            steps(
                'feed: { wire: "HOOK U\\n" }',
                "run: lift, args: { by: 3 }",
                "sent: { wire: LIFT 2 }",
            ),
            "5:9 3: wire: at byte 5, expected 'LIFT 2\\n' (4c 49 46 54 20 32 0a),"
            " found 'LIFT 3\\n' (4c 49 46 54 20 33 0a)",
        ),
        (
            steps('feed: { wire: "Login:\\n" }, sent: { wire: [] }', ready=False),
            "2:9 1: wire: at byte 0, expected nothing, found 'bob\\n' (62 6f 62 0a)",
        ),
        (
            steps('feed: { wire: "HOOK U\\n" }, expect: { hook: D }'),
            "3:9 1: hook: expected 'D', found 'U'",
        ),
        (
            steps('feed: { wire: "HOOK U" }, expect: { hook: U }'),
            "3:9 1: hook: expected 'U', but nothing set it:"
            " 'HOOK U' waits for the delimiter b'\\n' (write the delimiter in double quotes)",
        ),
        (
            steps('feed: { wire: "LOAD 3\\n" }, expect: { load: 3 }'),
            "3:9 1: no-match: no declaration matches 'LOAD 3'; load: expected 3, but nothing set"
            " it: 'LOAD 3' is a reply without its request (add polls: [load])",
        ),
        (
            steps('feed: { wire: "HOOK U\\n" }, expect: { load: { alarm: high } }'),
            "3:9 1: load: expected the alarm high, but nothing set it: the data in 'feed' set hook",
        ),
        (
            steps("wait: 1s, expect: { load: 3 }"),
            "3:9 1: load: expected 3, but nothing set it: nothing was fed",
        ),
        (
            steps('feed: { quiet: { hex: "07" } }, expect: { tone: 7 }'),
            "3:9 1: tone: expected 7, but nothing set it:"
            " 07 waits for the silence after the frame (add 'wait' to the step)",
        ),
        (
            steps('feed: { once: "A 3\\n" }', "expect: { load: 3 }"),
            "3:9 1: once is not connected: it cannot receive the data in 'feed'",
        ),
        (
            steps('feed: { wire: "what?\\n" }', "wait: 1s, expect: { hook: { age: never } }"),
            "3:9 1: no-match: no declaration matches 'what?' (if this is intended, add 'fails')",
        ),
        (
            steps("run: ask, sent: { once: ASK }", "wait: 9s"),
            "4:9 2: reply-timeout: no answer to ask within 2 s; timed-out: no answer to ask within"
            " 2 s; closed: no answer to ask within 2 s (if this is intended, add 'fails')",
        ),
        (
            steps("run: ask, fails: refused"),
            "3:9 1: it should fail with 'refused', but nothing failed",
        ),
        (
            steps("run: ask", "reply: {}"),
            "4:9 2: the command should have ended, but no reply arrived or no command was run",
        ),
        (
            steps("run: ask", 'feed: { once: "A 3\\n" }, reply: { load: 4, lode: 1 }'),
            "4:9 2: load: expected 4 in the reply of ask, found 3;"
            " the reply of ask has no 'lode'; it has: load",
        ),
        (
            steps("run: ask", 'feed: { once: "ERR\\n" }, reply: {}'),
            "4:9 2: refused: the robot answered 'ERR'; ask should have succeeded, but it failed",
        ),
        (
            steps('feed: { wire: "HOOK U\\n" }, expect: { hook: { age: never } }'),
            "3:9 1: hook: expected no value, found 'U'",
        ),
        (
            steps('feed: { wire: "HOOK U\\n" }', "wait: 9s, expect: { hook: { age: stale } }"),
            "4:9 2: hook: it should be stale, but the value is 9 s old (stale after 60 s)",
        ),
        (
            steps("wait: 1s, closed: wire"),
            "3:9 1: URC should have closed wire, but it is open",
        ),
    ],
)  # fmt: skip
def test_first_step_that_does_not_hold_is_told_at_its_place(
    test: str, told: str, tmp_path: Path
) -> None:
    """Its line and column, what was expected, what was found, and what to do."""
    assert outcome(tmp_path, test)[0] == [told]


ROVER = """
urc: 1
kind: robot
name: rover
transports:
  ros: { type: ros, host: robot }
  web: { type: http, url: "http://robot" }
signals: { x: {}, level: {} }
messages:
  x: { from: ros, subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: pose.x } }
commands:
  ring:
    to: ros
    args: { how: { type: array, items: integer } }
    send: { publish: { topic: /bell, type: std_msgs/Bell, json: { data: "{{ how }}" } } }
  reset:
    to: ros
    send: { call: { service: /reset, type: std_srvs/Trigger, json: {} } }
    reply: { json: { _ok: success } }
  put:
    to: web
    args: { n: { type: integer } }
    send: { request: { method: PUT, path: "/level/{{ n }}", text: "{{ n }}" } }
    reply: { regex: '^(?P<level>\\d+)$' }
tests:
  - name: it
"""
BELL = "run: ring, args: { how: [1, 2] }, sent: { ros: "
RUNG = "{ publish: { topic: /bell, json: { data: [1, 2] } } }"
ODOM = "feed: { ros: { message: { topic: %s, json: { pose: { x: 2 } } } } }, expect: { x: 2 }"


@pytest.mark.parametrize(
    ("test", "told"),
    [
        (steps(ODOM % "/odom"), ""),
        (steps(BELL + RUNG + "}"), ""),
        (
            steps(
                "run: reset, sent: { ros: [{ call: { service: /reset, json: {} } }] }",
                "run: reset",
                "feed: { ros: { response: { json: { success: true } } } }, reply: { ok: true }",
                "feed: { ros: { response: { ok: false, reason: busy } } }, fails: busy",
            ),
            "",
        ),
        (
            steps(
                "run: put, args: { n: 3 }",
                'sent: { web: { request: { path: /level/3, text: "3" } } }',
                'feed: { web: { response: { status: 200, hex: "34" } } }, expect: { level: 4 }',
            ),
            "",
        ),
        (
            steps(BELL + RUNG.replace("2", "3") + "}"),
            '3:9 1: ros: expected publish topic=/bell {"data": [1, 3]}, found publish topic=/bell'
            ' type=std_msgs/Bell {"data": [1, 2]}',
        ),
        (
            steps(f"{BELL}[{RUNG}, {{ cancel: {{ action: /x }} }}] }}"),
            "3:9 1: ros: expected cancel action=/x, found nothing",
        ),
        (
            steps("feed: { ros: { response: { json: {} } } }", "wait: 1s, sent: { ros: [] }"),
            "3:9 1: ros: no pending request for this response",
        ),
        (steps(ODOM % "/other"), None),
    ],
)  # fmt: skip
def test_messages_are_fed_and_compared(
    test: str, told: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Address and body; a number that the line adds is nobody's matter."""
    monkeypatch.setitem(globals(), "DRIVER", ROVER)
    found = outcome(tmp_path, test)[0]
    if told is None:
        assert "no declaration matches" in found[0]
    else:
        assert found == ([told] if told else [])


def test_time_without_end_is_told_and_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A poll of every second for a day is more than a test may ask."""
    monkeypatch.setattr("urc.runtime.test_engine._MOST_TICKS", 2000)
    test = "ready: true\npolls: [beat]\nsteps:\n  - { wait: 24h, fails: x }"
    assert outcome(tmp_path, test)[0] == ["4:9 1: more than 2000 deadlines are due within 86400 s"]
