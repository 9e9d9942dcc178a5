"""Telnet's own talk, byte by byte: what is text, what is answered, and that it always ends."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.transports.telnet_protocol import BINARY, ECHO, NAWS, SGA, TTYPE, TelnetNegotiation

IAC, SE, SB, WILL, WONT, DO, DONT = 255, 240, 250, 251, 252, 253, 254
LINEMODE, STATUS = 34, 5


def said(*parts: int | bytes) -> bytes:
    return b"".join(bytes((one,)) if isinstance(one, int) else one for one in parts)


def client(**options: object) -> TelnetNegotiation:
    return TelnetNegotiation(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ((WILL, SGA), (DO, SGA)),
        ((WILL, ECHO), (DO, ECHO)),
        ((DO, SGA), (WILL, SGA)),
        ((DO, BINARY), (WILL, BINARY)),
        ((DO, TTYPE), (WILL, TTYPE)),
        ((DO, LINEMODE), (WONT, LINEMODE)),
        ((WILL, STATUS), (DONT, STATUS)),
        ((DO, ECHO), (WONT, ECHO)),
        ((WONT, ECHO), ()),
        ((DONT, SGA), ()),
    ],
)
def test_each_request_has_its_answer(asked: tuple[int, int], answered: tuple[int, ...]) -> None:
    """What we do is taken on, the rest refused; what is off already needs no answer."""
    expected = said(IAC, *answered) if answered else b""
    assert client().receive(said(IAC, *asked)) == (b"", expected)


def test_refused_request_is_refused_each_time() -> None:
    """Servers negotiate in rounds, and wait for the answers of the last one."""
    talk = client()
    for _ in range(3):
        assert talk.receive(said(IAC, DO, LINEMODE))[1] == said(IAC, WONT, LINEMODE)


def test_what_is_agreed_is_not_answered_again() -> None:
    """Else two polite ends would never stop (RFC 854's loop)."""
    talk = client()
    assert talk.receive(said(IAC, WILL, SGA))[1] == said(IAC, DO, SGA)
    assert talk.receive(said(IAC, WILL, SGA))[1] == b""
    assert talk.receive(said(IAC, WONT, SGA))[1] == said(IAC, DONT, SGA)
    assert talk.receive(said(IAC, WONT, SGA))[1] == b""
    assert talk.theirs == frozenset()


def test_answer_to_our_own_wish_is_not_answered() -> None:
    """We asked, they agree, that is all."""
    talk = client()
    assert talk.requests(ours=(SGA,), theirs=(ECHO,)) == said(IAC, WILL, SGA, IAC, DO, ECHO)
    assert talk.requests(ours=(SGA,)) == b""
    assert talk.receive(said(IAC, DO, SGA, IAC, WONT, ECHO)) == (b"", b"")
    assert (talk.ours, talk.theirs) == (frozenset({SGA}), frozenset())


def test_terminal_is_named_once_it_was_agreed_to() -> None:
    """An asker that did not agree first gets nothing."""
    talk = client(terminal="VT220")
    ask = said(IAC, SB, TTYPE, 1, IAC, SE)
    assert talk.receive(ask) == (b"", b"")
    assert talk.receive(said(IAC, DO, TTYPE) + ask) == (
        b"",
        said(IAC, WILL, TTYPE, IAC, SB, TTYPE, 0, b"VT220", IAC, SE),
    )


def test_window_is_told_with_the_agreement() -> None:
    """255 columns are doubled like any other 255."""
    talk = client(columns=255, rows=24)
    assert talk.receive(said(IAC, DO, NAWS))[1] == said(
        IAC, WILL, NAWS, IAC, SB, NAWS, 0, IAC, IAC, 0, 24, IAC, SE
    )


@pytest.mark.parametrize(
    ("wire", "text"),
    [
        (b"\0\0login: ", b"login: "),
        (b"one\r\ntwo\r\0three\r\n", b"one\r\ntwo\rthree\r\n"),
        (b"a\xff\xffb", b"a\xffb"),
        (b"a\xff\xf1b\xff\xf2c\xff\xf9d", b"abcd"),
        (b"a\xff\xfa\x05" + b"x" * 100_000 + b"\xff\xf0b", b"ab"),
        (b"a\xff\xfa\x05zz\xff\xfb\x03b", b"ab"),
    ],
)
def test_text_is_what_is_left(wire: bytes, text: bytes) -> None:
    """Padding, doubled 255s, commands, Synch, and subnegotiations, one of them without its end."""
    assert client().receive(wire)[0] == text


def test_lone_cr_goes_out_with_nul_and_255_twice() -> None:
    """CR LF stays what it is."""
    talk = client()
    assert talk.encode(b"on\r") == b"on\r\0"
    assert talk.encode(b"on\r\noff\r\r\n") == b"on\r\noff\r\0\r\n"
    assert talk.encode(b"\xff\r\0") == b"\xff\xff\r\0"


def test_binary_leaves_bytes_alone() -> None:
    """Each direction by itself."""
    talk = client()
    talk.receive(said(IAC, DO, BINARY))
    assert talk.encode(b"\r\0\r") == b"\r\0\r"
    assert talk.receive(b"\0\r\0")[0] == b"\r"
    talk.receive(said(IAC, WILL, BINARY))
    assert talk.receive(b"\0\r\0")[0] == b"\0\r\0"


wire = st.lists(
    st.sampled_from([bytes((n,)) for n in (0, 1, 3, 10, 13, 24, 31, *range(239, 256))])
    | st.binary(max_size=5),
    max_size=40,
).map(b"".join)


@given(wire, st.lists(st.integers(0, 200)))
def test_bytes_may_be_cut_anywhere(data: bytes, cuts: list[int]) -> None:
    """Text and answers are the same in whichever pieces they come."""
    whole = client().receive(data)
    places = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    talk = client()
    pieces = [talk.receive(data[a:b]) for a, b in pairwise(places)]
    assert b"".join(text for text, _ in pieces) == whole[0]
    assert b"".join(answers for _, answers in pieces) == whole[1]


@given(st.binary(max_size=200))
def test_other_end_reads_what_was_encoded(data: bytes) -> None:
    """All but NUL, which text does not have, and the pair CR NUL that stands for CR."""
    text = data.replace(b"\0", b"")
    sender, receiver = client(), client()
    assert receiver.receive(sender.encode(text)) == (text, b"")


options = st.sampled_from([BINARY, ECHO, SGA, TTYPE, NAWS, STATUS, LINEMODE])
wishes = st.lists(options, max_size=5).map(tuple)
sides = st.frozensets(options)


@given(sides, sides, sides, sides, wishes, wishes, wishes, wishes)
def test_two_ends_always_come_to_an_end(
    a_ours: frozenset[int], a_theirs: frozenset[int], b_ours: frozenset[int],
    b_theirs: frozenset[int], a1: tuple[int, ...], a2: tuple[int, ...], b1: tuple[int, ...],
    b2: tuple[int, ...],
) -> None:  # fmt: skip
    """Whatever both want at once: they fall silent, and agree about what is on."""
    a, b = client(ours=a_ours, theirs=a_theirs), client(ours=b_ours, theirs=b_theirs)
    to_b, to_a = a.requests(ours=a1, theirs=a2), b.requests(ours=b1, theirs=b2)
    for _ in range(10):
        (_, from_b), (_, from_a) = b.receive(to_b), a.receive(to_a)
        to_a, to_b = from_b, from_a
    assert (to_a, to_b) == (b"", b"")
    assert (a.ours, a.theirs) == (b.theirs, b.ours)
