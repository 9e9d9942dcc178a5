"""Consoles with prompts, echoes and colours, and answers of different sizes on one line."""

from tests.dialogue import Dialogue

CONSOLE = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 23
    framing: { type: delimiter, tx: CR, rx: "robot> ", strip_ansi: true }
    timeouts: { connect: 1s, reply: 500ms }
signals:
  volts: {}
  mode: { type: string }
commands:
  status:
    send: status
    reply: { keyvalue: { pairs: "\\r\\n", separator: ":" } }
  volts:
    send: volts
    reply: { regex: 'volts: (?P<volts>[0-9.]+)\\r\\n', errors: ['unknown command'] }
"""
REGISTERS = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 23
    framing: { type: datagram }
    timeouts: { connect: 1s, reply: 500ms }
signals:
  version: { type: integer }
commands:
  firmware:
    send: { hex: "03 C0" }
    reply:
      framing:
        type: switch
        cases:
          - { first: ACK, framing: { type: fixed, size: 2 } }
          - { first: NAK, framing: { type: fixed, size: 1 } }
      struct: [u8 6, u8 version]
      errors: [{ struct: [u8 0x15], text: refused }]
"""


def test_an_answer_of_many_lines_ends_with_the_prompt() -> None:
    """The echo of the command stands in front of it, and colours are all over it."""
    talk = Dialogue(CONSOLE).connect()
    talk.raw(b"\x1b[2JWelcome\r\nrobot> ")
    number = talk.run("status")
    assert talk.sent == ["status\r"]
    for piece in (b"status\r\nvolts: 12", b".5\r\n\x1b[3", b"2mmode: ready\x1b[0m\r\nro", b"bot> "):
        assert number not in talk.outcomes
        talk.raw(piece)
    assert talk.outcomes[number] == "done"
    assert talk.values == {"volts": 12.5, "mode": "ready"}


def test_one_value_is_picked_out_of_the_lines() -> None:
    """A command that the console does not know fails with its own answer."""
    talk = Dialogue(CONSOLE).connect()
    first = talk.run("volts")
    talk.raw(b"volts\r\nvolts: 11.5\r\nrobot> ")
    second = talk.run("volts")
    talk.raw(b"volts\r\nunknown command\r\nrobot> ")
    assert (talk.outcomes[first], talk.outcomes[second]) == ("done", "refused")
    assert talk.values == {"volts": 11.5}


def test_a_refusal_that_is_shorter_than_the_answer_does_not_wait() -> None:
    """One byte refuses, two bytes answer: the framing of the reply tells them apart."""
    talk = Dialogue(REGISTERS).connect()
    first = talk.run("firmware")
    talk.raw(b"\x15")
    second = talk.run("firmware")
    talk.raw(b"\x06")
    assert second not in talk.outcomes
    talk.raw(b"\x05")
    assert (talk.outcomes[first], talk.outcomes[second]) == ("refused", "done")
    assert talk.values == {"version": 5}
