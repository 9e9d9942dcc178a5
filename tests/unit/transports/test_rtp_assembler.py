"""Images from RTP packets: whole ones in order, and never one with a missing packet."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.transports.rtp_packets import film, pieces_of, with_start_codes
from urc.transports.rtp_assembler import MOST_WAITING, RtpAssembler, RtpImage, RtpPiece
from urc.transports.rtp_payload import PAYLOADS, BadPayload
from urc.video import MAX_UNIT_BYTES

AVC = film(8)
FILMS = {False: AVC, True: film(8, is_hevc=True)}
SPS, KEY, DELTA = b"\x67\x42\x00\x1e", b"\x65image", b"\x41change"


def fed(assembler: RtpAssembler, pieces: list[RtpPiece]) -> list[RtpImage]:
    return [image for piece in pieces for image in assembler.add(piece)]


def data_of(images: list[RtpImage]) -> list[bytes]:
    return [image.data for image in images]


def at(number: int, payload: bytes, stamp: int = 0, *, last: bool = True, s: float = 0) -> RtpPiece:
    return RtpPiece(number, stamp, last, payload, s)


@pytest.mark.parametrize("is_hevc", [False, True])
@pytest.mark.parametrize("first", [0, 65_520])
def test_a_film_arrives_as_the_encoder_made_it(is_hevc: bool, first: int) -> None:
    """Also where the numbers and the time stamps begin anew."""
    units = FILMS[is_hevc]
    pieces = pieces_of(units, is_hevc=is_hevc, first=first)
    assert len(pieces) > 2 * len(units)
    images = fed(RtpAssembler(is_hevc=is_hevc), pieces)
    assert data_of(images) == [with_start_codes(unit) for unit in units]
    assert [image.is_after_loss for image in images] == [False] * len(units)
    assert images[1].came_s == pytest.approx(10.0 + 1 / 30)


def test_an_image_is_complete_with_its_last_packet() -> None:
    """Not only with the first packet of the next image."""
    pieces = [piece for piece in pieces_of(AVC) if piece.stamp == 4_294_960_000]
    assert len(fed(RtpAssembler(is_hevc=False), pieces)) == 1


def test_a_sender_without_marker_bits_loses_no_image() -> None:
    pieces = [piece._replace(is_last=False) for piece in pieces_of(AVC)]
    images = fed(RtpAssembler(is_hevc=False), pieces)
    assert data_of(images) == [with_start_codes(unit) for unit in AVC[:-1]]


def test_a_marker_after_the_parameter_sets_does_not_split_the_image() -> None:
    pieces = [at(1, SPS), at(2, KEY)]
    assert data_of(fed(RtpAssembler(is_hevc=False), pieces)) == [
        b"\0\0\0\1" + SPS + b"\0\0\0\1" + KEY
    ]


@given(seed=st.integers(0, 2**32), repeats=st.integers(0, 5))
def test_late_and_repeated_packets_change_nothing(seed: int, repeats: int) -> None:
    chance = random.Random(seed)  # noqa: S311 - for a test
    pieces = pieces_of(AVC)
    first, rest = pieces[0], pieces[1:]
    rest += chance.choices(rest, k=repeats)
    chance.shuffle(rest)
    came = [piece._replace(came_s=10.0) for piece in [first, *rest]]
    images = fed(RtpAssembler(is_hevc=False), came)
    assert data_of(images) == [with_start_codes(unit) for unit in AVC]
    assert not any(image.is_after_loss for image in images)


@given(lost=st.sets(st.integers(0, len(pieces_of(AVC)) - 1), min_size=1, max_size=6))
def test_an_image_with_a_lost_packet_is_never_delivered(lost: set[int]) -> None:
    """What arrives is a whole image of the film, and the first one after a loss says so."""
    pieces = pieces_of(AVC, every_s=1.0)
    kept = [piece for place, piece in enumerate(pieces) if place not in lost]
    images = fed(RtpAssembler(is_hevc=False), kept)
    whole = [with_start_codes(unit) for unit in AVC]
    places = [whole.index(image.data) for image in images]
    hurt = {(pieces[place].stamp - 4_294_960_000) % 2**32 // 3000 for place in lost}
    assert places == sorted(places)
    assert not hurt.intersection(places)
    for place, image, before in zip(places, images, [-1, *places], strict=False):
        assert image.is_after_loss == (place != before + 1)


def test_the_sender_is_asked_for_what_is_missing() -> None:
    assembler = RtpAssembler(is_hevc=False)
    fed(assembler, [at(65_534, SPS, last=False), at(1, KEY), at(2, DELTA, 3000)])
    assert assembler.missing() == [65_535, 0]
    assert data_of(assembler.add(at(65_535, b"\x68pps", last=False))) == []
    assert assembler.missing() == [0]
    assert len(fed(assembler, [at(0, b"\x06sei", last=False)])) == 2
    assert assembler.missing() == []


def test_the_wait_for_a_missing_packet_ends() -> None:
    assembler = RtpAssembler(is_hevc=False)
    fed(assembler, [at(1, SPS, last=False), at(2, KEY)])
    assert fed(assembler, [at(4, DELTA, 6000, s=1.0), at(5, DELTA, 9000, s=1.2)]) == []
    found = fed(assembler, [at(6, DELTA, 12_000, s=1.21)])
    assert [(image.stamp, image.is_after_loss) for image in found] == [
        (9000, True),
        (12_000, False),
    ]
    assert assembler.add(at(3, DELTA, 3000, s=1.22)) == [], "too late"


def test_a_keyframe_with_parameter_sets_is_whole_after_a_gap() -> None:
    """Its first NAL unit proves that nothing of the image came before."""
    assembler = RtpAssembler(is_hevc=False)
    fed(assembler, [at(1, SPS, last=False), at(2, KEY)])
    found = fed(assembler, [at(4, SPS, 6000, last=False, s=1.0), at(5, KEY, 6000, s=1.3)])
    assert [(image.stamp, image.is_after_loss) for image in found] == [(6000, True)]


def test_waiting_packets_take_bounded_memory() -> None:
    assembler = RtpAssembler(is_hevc=False)
    assembler.add(at(0, SPS, last=False))
    for number in range(2, 3 * MOST_WAITING):
        assembler.add(at(number, DELTA, number))
        assert len(assembler._waiting) <= MOST_WAITING


def test_a_sender_that_numbers_anew_is_followed() -> None:
    assembler = RtpAssembler(is_hevc=False)
    fed(assembler, [at(10, SPS, last=False), at(11, KEY)])
    found = fed(assembler, [at(30_000, SPS, 9, last=False), at(30_001, KEY, 9)])
    assert [(image.stamp, image.is_after_loss) for image in found] == [(9, True)]


def test_an_endless_image_takes_bounded_memory() -> None:
    """Its reader refuses it, because it exceeds the limit."""
    assembler = RtpAssembler(is_hevc=False)
    assembler.add(at(0, SPS, last=False))
    piece = b"\x5c\x05" + bytes(4000)
    assembler.add(at(1, b"\x5c\x85" + bytes(4000), last=False))
    for number in range(2, 1500):
        assembler.add(at(number, piece, last=False))
    found = assembler.add(at(1500, b"\x5c\x45end"))
    assert MAX_UNIT_BYTES < len(found[0].data) < MAX_UNIT_BYTES + 8000


def test_an_image_is_at_least_as_old_as_a_later_one() -> None:
    """Its first packet may come after those of later images."""
    assembler = RtpAssembler(is_hevc=False)
    fed(assembler, [at(1, SPS, last=False), at(2, KEY)])
    found = fed(assembler, [at(4, DELTA, 6000, s=1.0), at(3, DELTA, 3000, s=1.1)])
    assert [(image.stamp, image.came_s) for image in found] == [(3000, 1.0), (6000, 1.0)]


def test_padding_is_no_image() -> None:
    pieces = [at(1, SPS, last=False), at(2, b""), at(3, KEY), at(4, b"", 5)]
    assert len(fed(RtpAssembler(is_hevc=False), pieces)) == 1


@pytest.mark.parametrize(
    ("is_hevc", "payload"),
    [
        (False, b"\x1d\0\0\0\0"),  # FU-B
        (False, b"\x1c\x85"),
        (False, b"\x18\x00\x09\x67"),
        (False, b"\x18\x00\x00\x67"),
        (False, b"\x18\x00"),
        (False, b"\x00\x00"),
        (True, bytes([50 << 1, 1]) + b"paci"),
        (True, bytes([49 << 1, 1, 0x80])),
        (True, bytes([48 << 1, 1, 0, 9, 1])),
        (True, b"\x02\x01"),
    ],
)
def test_an_invalid_payload_damages_its_image(is_hevc: bool, payload: bytes) -> None:
    with pytest.raises(BadPayload):
        PAYLOADS[is_hevc].parts(payload)
    opener, slice_ = (b"\x40\x01vps", b"\x26\x01key") if is_hevc else (SPS, KEY)
    pieces = [at(1, opener, last=False), at(2, payload, last=False), at(3, slice_)]
    assert fed(RtpAssembler(is_hevc=is_hevc), pieces) == []


@given(st.booleans(), st.lists(st.tuples(st.integers(0, 65_535), st.binary(max_size=40))))
def test_no_packet_breaks_the_assembler(is_hevc: bool, packets: list[tuple[int, bytes]]) -> None:
    assembler = RtpAssembler(is_hevc=is_hevc)
    for number, payload in packets:
        for image in assembler.add(at(number, payload, number // 4, last=number % 4 == 3)):
            assert image.data.startswith(b"\0\0\0\1")
