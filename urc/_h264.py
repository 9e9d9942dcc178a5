"""Structure of H.264 and H.265 streams: NAL units, keyframes, codec strings and the size in pixels.

Pure. Access units are in the byte stream format with start codes (ITU-T H.264, Annex B). Only the
parameter sets are read, without decoding any image. A size is therefore known before a decoder
reserves memory for it. Sources: ITU-T H.264 (7.3.1, 7.3.2.1.1), ITU-T H.265 (7.3.1.2, 7.3.2.2,
7.3.3), RFC 6381 and ISO/IEC 14496-15 (codec strings).
"""

from collections.abc import Iterator
from typing import NamedTuple

__all__ = ["BadStream", "StreamInfo", "info_of", "is_keyframe", "nal_units", "with_parameter_sets"]

_SPS, _PPS, _IDR = 7, 8, 5
_HEVC_VPS, _HEVC_SPS, _HEVC_PPS = 32, 33, 34
_HEVC_KEYS = range(16, 22)
"""H.265 NAL unit types of random access points: BLA, IDR and CRA."""
_CHROMA_PROFILES = frozenset((100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135))
_START = b"\x00\x00\x01"
_SPS_BYTES = 1024
"""Number of bytes of a sequence parameter set that are read; the size comes early."""
_LONGEST_CODE = 32
"""Maximum number of leading zero bits of an Exp-Golomb code."""


class BadStream(ValueError):
    """Raised for a parameter set that violates the format."""


class StreamInfo(NamedTuple):
    """The properties of a stream that its sequence parameter set states."""

    codec: str
    """Codec string of RFC 6381, such as ``avc1.42E01E``."""
    width: int
    height: int


def nal_units(data: bytes) -> Iterator[bytes]:
    """Yield the NAL units of an access unit, without start codes and trailing zeros."""
    start = data.find(_START)
    while start >= 0:
        after = start + len(_START)
        following = data.find(_START, after)
        nal = data[after : following if following >= 0 else len(data)].rstrip(b"\x00")
        if nal:
            yield nal
        start = following


def is_keyframe(data: bytes, *, is_hevc: bool) -> bool:
    """Return whether decoding can start with an access unit."""
    if is_hevc:
        return any(_hevc_type(nal) in _HEVC_KEYS for nal in nal_units(data))
    return any(nal[0] & 0x1F == _IDR for nal in nal_units(data))


def with_parameter_sets(data: bytes, extra: bytes, *, is_hevc: bool) -> bytes:
    """Return a keyframe that contains its parameter sets.

    Args:
        data: the keyframe's access unit.
        extra: parameter sets that the container states separately; used if `data` has none.
        is_hevc: whether the stream is H.265 instead of H.264.
    """
    if _sps_of(data, is_hevc=is_hevc) is not None:
        return data
    wanted = (_HEVC_VPS, _HEVC_SPS, _HEVC_PPS) if is_hevc else (_SPS, _PPS)
    kind = _hevc_type if is_hevc else _type
    sets = [nal for nal in nal_units(extra) if kind(nal) in wanted]
    return b"".join(b"\x00" + _START + nal for nal in sets) + data


def info_of(data: bytes, *, is_hevc: bool) -> StreamInfo | None:
    """Return the properties in an access unit's parameter sets; None if it has none.

    Raises:
        BadStream: the sequence parameter set violates the format.
    """
    sps = _sps_of(data, is_hevc=is_hevc)
    if sps is None:
        return None
    body = sps.replace(b"\x00\x00\x03", b"\x00\x00")[:_SPS_BYTES]  # emulation prevention
    try:
        return _hevc_info(body) if is_hevc else _avc_info(body)
    except IndexError as error:
        raise BadStream("the sequence parameter set is truncated") from error


def _sps_of(data: bytes, *, is_hevc: bool) -> bytes | None:
    kind, wanted = (_hevc_type, _HEVC_SPS) if is_hevc else (_type, _SPS)
    return next((nal for nal in nal_units(data) if kind(nal) == wanted), None)


def _type(nal: bytes) -> int:
    return nal[0] & 0x1F


def _hevc_type(nal: bytes) -> int:
    return nal[0] >> 1 & 0x3F


class _Bits:
    """A reader of bits, most significant first; raises `IndexError` at the end."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._place = 0

    def bits(self, count: int) -> int:
        """Return the next `count` bits as a number."""
        value = 0
        for _ in range(count):
            byte = self._data[self._place >> 3]
            value = value << 1 | byte >> (7 - (self._place & 7)) & 1
            self._place += 1
        return value

    def number(self) -> int:
        """Return the next Exp-Golomb code as a number without a sign (H.264, 9.1)."""
        zeros = 0
        while not self.bits(1):
            zeros += 1
            if zeros > _LONGEST_CODE:
                raise BadStream("the sequence parameter set contains an invalid code")
        return (1 << zeros) - 1 + self.bits(zeros)

    def signed(self) -> int:
        """Return the next Exp-Golomb code as a number with a sign (H.264, 9.1.1)."""
        code = self.number()
        return (code + 1) // 2 if code & 1 else -(code // 2)


def _avc_info(sps: bytes) -> StreamInfo:
    profile = sps[1]
    codec = f"avc1.{sps[1:4].hex().upper()}"
    if len(sps) < 4:
        raise IndexError
    bits = _Bits(sps[4:])
    bits.number()  # seq_parameter_set_id
    chroma, is_separate = 1, 0
    if profile in _CHROMA_PROFILES:
        chroma = bits.number()
        is_separate = bits.bits(1) if chroma == 3 else 0
        bits.number()  # bit_depth_luma_minus8
        bits.number()  # bit_depth_chroma_minus8
        bits.bits(1)  # qpprime_y_zero_transform_bypass_flag
        if bits.bits(1):
            for index in range(8 if chroma != 3 else 12):
                if bits.bits(1):
                    _skip_scaling_list(bits, 16 if index < 6 else 64)
    bits.number()  # log2_max_frame_num_minus4
    _skip_picture_order(bits)
    bits.number()  # max_num_ref_frames
    bits.bits(1)  # gaps_in_frame_num_value_allowed_flag
    columns, rows = bits.number() + 1, bits.number() + 1
    is_frame_only = bits.bits(1)
    if not is_frame_only:
        bits.bits(1)  # mb_adaptive_frame_field_flag
    bits.bits(1)  # direct_8x8_inference_flag
    left = right = top = bottom = 0
    if bits.bits(1):
        left, right, top, bottom = (bits.number() for _ in range(4))
    is_plain = is_separate or chroma == 0
    across = 1 if is_plain or chroma == 3 else 2
    down = (1 if is_plain or chroma in (2, 3) else 2) * (2 - is_frame_only)
    width = 16 * columns - across * (left + right)
    height = 16 * rows * (2 - is_frame_only) - down * (top + bottom)
    return _checked(codec, width, height)


def _skip_scaling_list(bits: _Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            following = (last + bits.signed()) % 256
        last = following or last


def _skip_picture_order(bits: _Bits) -> None:
    kind = bits.number()
    if kind == 0:
        bits.number()  # log2_max_pic_order_cnt_lsb_minus4
    elif kind == 1:
        bits.bits(1)  # delta_pic_order_always_zero_flag
        bits.signed()  # offset_for_non_ref_pic
        bits.signed()  # offset_for_top_to_bottom_field
        count = bits.number()
        if count > 255:
            raise BadStream("the sequence parameter set contains an invalid picture order")
        for _ in range(count):
            bits.signed()


def _hevc_info(sps: bytes) -> StreamInfo:
    layers = sps[2] >> 1 & 0x07
    profile = sps[3]
    flags = int.from_bytes(sps[4:8], "big")
    reversed_flags = int(f"{flags:032b}"[::-1], 2)
    constraints = sps[8:14]
    level = sps[14]
    tail = "".join(f".{one:X}" for one in constraints.rstrip(b"\x00"))
    space = ("", "A", "B", "C")[profile >> 6]
    tier = "H" if profile >> 5 & 1 else "L"
    codec = f"hev1.{space}{profile & 0x1F}.{reversed_flags:X}.{tier}{level}{tail}"
    bits = _Bits(sps[15:])
    _skip_layers(bits, layers)
    bits.number()  # sps_seq_parameter_set_id
    chroma = bits.number()
    is_separate = bits.bits(1) if chroma == 3 else 0
    width, height = bits.number(), bits.number()
    if bits.bits(1):
        left, right, top, bottom = (bits.number() for _ in range(4))
        across = 2 if chroma in (1, 2) and not is_separate else 1
        down = 2 if chroma == 1 and not is_separate else 1
        width -= across * (left + right)
        height -= down * (top + bottom)
    return _checked(codec, width, height)


def _skip_layers(bits: _Bits, layers: int) -> None:
    """Skip the profiles and levels of the temporal sub-layers."""
    present = [(bits.bits(1), bits.bits(1)) for _ in range(layers)]
    if layers:
        bits.bits(2 * (8 - layers))
    for has_profile, has_level in present:
        bits.bits(88 * has_profile + 8 * has_level)


def _checked(codec: str, width: int, height: int) -> StreamInfo:
    if width < 1 or height < 1:
        raise BadStream(f"the sequence parameter set states {width} by {height} pixels")
    return StreamInfo(codec, width, height)
