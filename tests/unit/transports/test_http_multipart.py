"""Pictures are cut out of a multipart body however it comes, and however careless the camera is."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.transports.http_multipart import MultipartFault, MultipartParser, boundary_of

JPEG = b"\xff\xd8 \r\n a picture --\xff\xd9"
OTHER = b"\xff\xd8 another\r\n--one \xff\xd9"

BODIES = {
    "counted": b"--B\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%b\r\n",
    "lower case": b"--B\r\ncontent-length:%d\r\n\r\n%b\r\n",
    "counted, no end of line after": b"--B\r\nContent-Length: %d\r\n\r\n%b",
    "counted, LF alone": b"--B\nContent-Length: %d\n\n%b\n",
    "more after the boundary": b"--B  \r\nContent-Length: %d\r\n\r\n%b\r\n",
    "more dashes": b"------B\r\nContent-Length: %d\r\n\r\n%b\r\n",
    "no dashes at all": b"B\r\nContent-Length: %d\r\n\r\n%b\r\n",
}


def cut(data: bytes, size: int | None = None, most: int = 1000) -> list[bytes]:
    cutter = MultipartParser(b"B", most)
    step = size or len(data)
    return [
        part
        for start in range(0, len(data), step)
        for part in cutter.feed(data[start : start + step])
    ]


@pytest.mark.parametrize("form", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("size", [None, 1, 7])
def test_counted_parts_come_out_whole(form: bytes, size: int | None) -> None:
    """In one piece, byte by byte, and anything between; a boundary in a picture is no end."""
    inside = b"\xff\xd8\r\n--B\r\n\r\n\xff\xd9"
    body = b"".join(form % (len(part), part) for part in (JPEG, inside, OTHER))
    assert cut(body, size) == [JPEG, inside, OTHER]


@pytest.mark.parametrize("end", [b"\r\n", b"\n"])
@pytest.mark.parametrize("size", [None, 1, 7])
def test_parts_without_a_length_end_at_the_next_boundary(end: bytes, size: int | None) -> None:
    """The last one is not complete before the boundary after it has come."""
    head = b"--B" + end + b"Content-Type: image/jpeg" + end + end
    body = b"".join(head + part + end for part in (JPEG, OTHER))
    assert cut(body, size) == [JPEG]
    assert cut(body + b"--B", size) == [JPEG, OTHER]


def test_part_without_any_header() -> None:
    """The empty line comes at once."""
    assert cut(b"--B\r\n\r\n" + JPEG + b"\r\n--B\r\n") == [JPEG]


def test_nothing_counts_after_the_end() -> None:
    """The closing boundary has two more dashes."""
    cutter = MultipartParser(b"B", 100)
    body = b"--B\r\nContent-Length: 1\r\n\r\nx\r\n--B--\r\n--B\r\nContent-Length: 1\r\n\r\ny"
    assert cutter.feed(body) == [b"x"]
    assert cutter.feed(b"--B\r\nContent-Length: 1\r\n\r\nz") == []


@given(
    st.lists(st.binary(max_size=60).filter(lambda part: b"B" not in part), max_size=4),
    st.lists(st.integers(1, 40), min_size=1),
    st.booleans(),
)
def test_pieces_make_no_difference(parts: list[bytes], sizes: list[int], counted: bool) -> None:
    """Any bytes, cut anywhere, with lengths or without."""
    length = (lambda part: b"Content-Length: %d\r\n" % len(part)) if counted else (lambda part: b"")
    body = (
        b"".join(b"--B\r\n" + length(part) + b"\r\n" + part + b"\r\n" for part in parts) + b"--B--"
    )
    cutter = MultipartParser(b"B", 100)
    found: list[bytes] = []
    turn = 0
    while body:
        size = sizes[turn % len(sizes)]
        found += cutter.feed(body[:size])
        body, turn = body[size:], turn + 1
    assert found == parts


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_anything_at_all_ends_in_parts_or_a_fault(pieces: list[bytes]) -> None:
    """Nothing else is raised, and no part is larger than allowed."""
    cutter = MultipartParser(b"B", 50)
    try:
        parts = [part for piece in pieces for part in cutter.feed(b"--B\r\n" + piece)]
    except MultipartFault:
        return
    assert all(len(part) <= 50 for part in parts)


TOO_MUCH = {
    "a part has 1001 bytes; at most 1000 are permitted": b"--B\r\nContent-Length: 1001\r\n\r\n",
    "a part has no end within 1000 bytes": b"--B\r\n\r\n" + b"x" * 2000,
    "the headers of a part exceed 8192 bytes": b"--B\r\n" + b"X: y\r\n" * 2000,
    "no boundary within 8192 bytes": b"x" * 9000,
}


@pytest.mark.parametrize(("told", "body"), TOO_MUCH.items())
@pytest.mark.parametrize("size", [None, 500])
def test_everything_has_a_bound(told: str, body: bytes, size: int | None) -> None:
    """What exceeds it is a fault, whole or in pieces."""
    with pytest.raises(MultipartFault) as fault:
        cut(body, size)
    assert str(fault.value) == told


@pytest.mark.parametrize(
    ("header", "boundary"),
    [
        ("multipart/x-mixed-replace;boundary=ffmpeg", b"ffmpeg"),
        ('multipart/x-mixed-replace; boundary="my frame"', b"my frame"),
        ("multipart/x-mixed-replace; boundary=--myboundary", b"myboundary"),
        ("Multipart/X-Mixed-Replace; charset=x; BOUNDARY=123456789000000000000987654321",
         b"123456789000000000000987654321"),
    ],
)  # fmt: skip
def test_boundary_is_read_as_cameras_write_it(header: str, boundary: bytes) -> None:
    """Quoted or not, with the dashes of the body or without."""
    assert boundary_of(header) == boundary


@pytest.mark.parametrize(
    ("header", "told"),
    [
        ("image/jpeg", "the response is image/jpeg, not multipart/x-mixed-replace"),
        ("", "the response is no Content-Type, not multipart/x-mixed-replace"),
        ("multipart/x-mixed-replace", "the Content-Type has no boundary"),
        ("multipart/x-mixed-replace; boundary=--", "the Content-Type has no boundary"),
        (
            "multipart/x-mixed-replace; boundary=" + "x" * 201,
            "the boundary has more than 200 characters, or contains invalid characters",
        ),
    ],
)
def test_other_answers_are_told(header: str, told: str) -> None:
    """A camera that sends something else is no camera that streams."""
    with pytest.raises(MultipartFault) as fault:
        boundary_of(header)
    assert str(fault.value) == told
