"""A compiled engine: whatever is said, it tells what one without compiled functions tells."""

from collections.abc import Callable, Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.dialogue import driver_of
from tests.effort import examples
from urc.model.driver import Driver
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Request

TEXT = """
signals:
  volts: { min: 0, max: 60, limits: { low: 20 } }
  x: {}
  twice: { value: x * 2 }
  mode: { type: string }
messages:
  bat: { pattern: "BAT {volts:number}" }
  mode: { pattern: "MODE {mode:word}" }
commands:
  drive:
    send: "VEL {{ (v * 1000) | fixed(1) }} {{ n }}"
    args: { v: { min: -1, max: 1 }, n: { type: integer, default: 3 } }
    reply: { pattern: "POS {x:number}" }
  say: { send: "SAY {{ v }}", args: { v: { type: number } } }
  list: { send: list, reply: { pattern: "POS {x:number}", lines: 2 } }
  try: { send: try, reply: { pattern: "BAT {volts:number}", errors: ["^ERR"] } }
  twice: { send: twice, reply: { pattern: "POS {x:number}" }, retries: 1, idempotent: true }
  go: { send: go, reply: { pattern: "POS {x:number}" }, verify: { expr: x > 1, within: 1s } }
  only: { send: only, requires: [{ expr: x > 0, else: it must stand }] }
sequences:
  both: { steps: [{ run: list }, { run: drive, args: { v: 0.5 } }] }
"""
POLLED = "polls: [{ send: POLL, reply: { pattern: 'POS {x:number}' }, every: 300ms }]\n"
CALM = "\n".join(
    line for line in TEXT.splitlines() if not line.startswith(("sequences", "  both", "  go"))
)
"""Without what may be due at once."""
GAP = "wire: min_gap: 100ms\n"
BINARY = """
transports:
  wire:
    type: tcp
    host: robot
    port: 1
    framing: { type: fixed, size: 4, checksum: { algorithm: xor8 } }
signals: { volts: { max: 200 }, x: {} }
messages:
  one: { struct: [u8 1, u8 volts, u8 x] }
  two: { struct: [u8 2, u8 x, u8 volts] }
commands:
  drive: { send: { hex: "03 00 00" }, reply: { struct: [u8 3, u8 x, u8 0] } }
  say: { send: { hex: "04 00 00" } }
"""
DOCUMENTS = {
    "plain": TEXT,
    "polled": TEXT + POLLED,
    "calm": f"{CALM}\n{POLLED}",
    "gap": TEXT + GAP,
    "binary": BINARY,
}
DRIVERS = {name: driver_of(text) for name, text in DOCUMENTS.items()}

Deed = Callable[[Engine, float], Sequence[Event]]


def commanded(name: str, arguments: dict[str, float]) -> Deed:
    return lambda engine, now: engine.command(Request(7, name, arguments), now)


def heard(data: bytes) -> Deed:
    return lambda engine, now: engine.receive("wire", data, now)


def ticked(engine: Engine, now: float) -> Sequence[Event]:
    return engine.tick(now)


def closed(engine: Engine, now: float) -> Sequence[Event]:
    return [*engine.closed("wire", "cable", now), *engine.start("wire", now)]


arguments = st.sampled_from(
    [
        {},
        {"v": 0.5},
        {"v": 0.5, "n": 4},
        {"v": 1, "n": 4},
        {"v": 2.0, "n": 4},
        {"v": float("nan")},
        {"v": 0.5, "n": 2**70},
        {"v": 0.1, "n": 1.5},
        {"v": True, "n": 1},
    ]
)
names = st.sampled_from([*DRIVERS["plain"].commands, "nobody"])
LINES = b"POS 1.5\n|POS 2\nBAT 30\n|BAT 12\n|BAT 99\n|POS nan\n|POS 1_0\n|ERR 3\n|MODE a\n|?\n"
LINES += b"|\n|POS 4\nPO|S 5\n"
FRAMES = b"\1\5\6\2|\2\5\6\1|\3\7\0\4|\3\7\0\5|\1\xff\6\xf8|\1\5|\6\2|\1\5\6\2\2\5\6\1"
chunks = st.sampled_from([*LINES.split(b"|"), *FRAMES.split(b"|")])
ready_reactions = st.lists(
    st.tuples(
        st.one_of(
            st.builds(commanded, names, arguments),
            st.builds(heard, chunks),
            st.sampled_from([ticked, closed]),
        ),
        st.sampled_from([0.0, 0.0, 0.05, 0.3, 0.6]),
    ),
    min_size=10,  # making an engine takes longer than all that is said to it
    max_size=40,
)


def connected(driver: Driver, *, is_compiled: bool) -> Engine:
    """Return an engine whose line is up."""
    engine = Engine(driver, {}, is_compiled=is_compiled)
    engine.tick(0.0)
    engine.start("wire", 0.0)
    return engine


@pytest.mark.parametrize("name", DRIVERS)
@settings(max_examples=examples(240), deadline=None)
@given(ready_reactions=ready_reactions)
def test_compiled_engine_tells_what_the_other_tells(
    name: str, ready_reactions: Sequence[tuple[Deed, float]]
) -> None:
    """The same events, in the same order, and the same deadline after each of them."""
    compiled, other = (connected(DRIVERS[name], is_compiled=one) for one in (True, False))
    now = 1.0
    for reaction, wait_s in ready_reactions:
        now += wait_s
        assert [*reaction(compiled, now)] == [*reaction(other, now)]
        assert compiled.deadline == other.deadline


@pytest.mark.parametrize("name", DRIVERS)
@settings(max_examples=examples(120), deadline=None)
@given(ready_reactions=ready_reactions)
def test_no_deadline_comes_nearer_than_the_calm(
    name: str, ready_reactions: Sequence[tuple[Deed, float]]
) -> None:
    """So whoever has set an alarm for before that need not look again after each frame."""
    engine, now = connected(DRIVERS[name], is_compiled=False), 1.0
    for reaction, wait_s in ready_reactions:
        now += wait_s
        before = engine.deadline
        reaction(engine, now)
        after = engine.deadline
        if reaction in (ticked, closed) or after is None:
            continue
        assert after >= min(now + engine.calm_s, float("inf") if before is None else before)


def test_plain_driver_is_calm() -> None:
    """A driver of commands and messages alone has no deadline before its shortest answer's."""
    driver = driver_of(
        "signals: { x: {} }\ncommands: { ask: { send: a, reply: { pattern: 'POS {x:number}' } } }"
    )
    assert Engine(driver, {}).calm_s == 0.5
    assert Engine(DRIVERS["calm"], {}).calm_s == 0.3  # its poll
    assert Engine(DRIVERS["gap"], {}).calm_s == 0.0
