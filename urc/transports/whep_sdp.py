"""Offers and answers of WHEP, in the Session Description Protocol (RFC 8866, RFC 8829).

Pure. URC offers to receive one video. An answer comes from a camera that may be hostile: each part
is checked, and only candidates of the camera's own addresses are kept. URC therefore never sends a
packet to another computer.
"""

import ipaddress
import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from urc._addresses import Address, unmapped
from urc.transports._faults import one_line, place_of
from urc.transports.base import PeerClosed

__all__ = ["MAX_ANSWER_BYTES", "IceHost", "WhepAnswer", "offer_text", "read_answer"]

MAX_ANSWER_BYTES: Final = 65536
MAX_CANDIDATES: Final = 20
_H264: Final = ("42e01f", "42001f", "4d001f", "64001f")
"""Offered profiles and levels: constrained baseline, baseline, main and high."""
_FIRST_TYPE: Final = 102
_CODECS: Final = {"H264/90000": False, "H265/90000": True}
"""Whether the codec is H.265, keyed by its name and clock rate."""
_HEAD: Final = "v=0"
_WORD: Final = re.compile(r"[A-Za-z0-9+/]{4,256}")
_SECRET: Final = re.compile(r"[A-Za-z0-9+/]{22,256}")
_FINGERPRINT: Final = re.compile(r"(sha-256|sha-384|sha-512) ([0-9A-F]{2}(?::[0-9A-F]{2})+)", re.I)
_CANDIDATE: Final = re.compile(
    r"(?P<foundation>[A-Za-z0-9+/]{1,32}) 1 udp (?P<priority>[0-9]{1,10})"
    r" (?P<host>[^ ]{1,253}) (?P<port>[0-9]{1,5}) typ [a-z]+(?: .*)?",
    re.I,
)
_SHOWN_HOSTS: Final = 3


class IceHost(NamedTuple):
    """An address and port to which packets may go: a candidate of ICE (RFC 8445)."""

    address: str
    port: int
    priority: int
    foundation: str


class WhepAnswer(NamedTuple):
    """A checked answer."""

    user: str
    """ICE user name fragment."""
    password: str
    is_lite: bool
    """Whether the server answers checks but sends none."""
    fingerprints: tuple[tuple[str, str], ...]
    """Hash function and hash of the server's certificate."""
    starts_tls: bool
    """Whether the server, not URC, begins the DTLS handshake."""
    codecs: tuple[tuple[int, bool], ...]
    """Payload types, and whether the codec is H.265 instead of H.264."""
    hosts: tuple[IceHost, ...]


def offer_text(
    *, user: str, password: str, fingerprints: Sequence[tuple[str, str]], candidates: Sequence[str]
) -> str:
    """Return the offer to receive one video.

    Args:
        user: ICE user name fragment.
        password: ICE password.
        fingerprints: hash functions and hashes of URC's certificate.
        candidates: URC's own addresses, in the notation of ICE.
    """
    types = range(_FIRST_TYPE, _FIRST_TYPE + len(_H264) + 1)
    lines = [
        *(_HEAD, "o=- 1 1 IN IP4 127.0.0.1", "s=-", "t=0 0", "a=group:BUNDLE 0"),
        f"m=video 9 UDP/TLS/RTP/SAVPF {' '.join(map(str, types))}",
        *("c=IN IP4 0.0.0.0", "a=rtcp:9 IN IP4 0.0.0.0", "a=mid:0", "a=recvonly"),
        *("a=rtcp-mux", "a=rtcp-rsize", "a=setup:actpass"),
        *(f"a=ice-ufrag:{user}", f"a=ice-pwd:{password}"),
        *(f"a=fingerprint:{name} {value}" for name, value in fingerprints),
    ]
    for number, level in zip(types, _H264, strict=False):
        lines += [f"a=rtpmap:{number} H264/90000", *_feedback(number)]
        lines.append(
            f"a=fmtp:{number} level-asymmetry-allowed=1;packetization-mode=1;"
            f"profile-level-id={level}"
        )
    lines += [f"a=rtpmap:{types[-1]} H265/90000", *_feedback(types[-1])]
    lines.append(f"a=fmtp:{types[-1]} level-id=180;profile-id=1;tier-flag=0;tx-mode=SRST")
    lines += [f"a=candidate:{one}" for one in candidates]
    return "\r\n".join([*lines, "a=end-of-candidates", ""])


def _feedback(number: int) -> tuple[str, str]:
    """Return the permitted requests: repetition of packets, and a keyframe (RFC 4585)."""
    return f"a=rtcp-fb:{number} nack", f"a=rtcp-fb:{number} nack pli"


def read_answer(text: str, hosts: Sequence[str]) -> WhepAnswer:
    """Return a checked answer.

    Args:
        text: the answer.
        hosts: IP addresses of the camera, at least one. Other candidates are ignored.

    Raises:
        PeerClosed: the answer is invalid, contains no suitable video or no address of the camera.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if not lines or lines[0] != _HEAD:
        raise PeerClosed(f"the answer is not SDP, but begins with {one_line(text, 60)!r}")
    session, media = _sections(lines)
    video = next((part for part in media if part[0].startswith("m=video ")), None)
    if video is None:
        raise PeerClosed("the server's answer contains no video")
    codecs = _codecs(video)
    found = _Attributes([*session, *video])
    if not codecs or found.has("inactive") or found.has("recvonly"):
        raise PeerClosed(
            "the server sends neither H.264 nor H.265: select one of them in the camera's or"
            " server's settings"
        )
    fingerprints = tuple(_fingerprints(found))
    setup = found.first("setup")
    user, password = found.first("ice-ufrag"), found.first("ice-pwd")
    for part, is_there in (
        ("rtcp-mux", found.has("rtcp-mux")),
        ("fingerprint", bool(fingerprints)),
        ("setup", setup in ("active", "passive")),
        ("ice-ufrag", bool(_WORD.fullmatch(user))),
        ("ice-pwd", bool(_SECRET.fullmatch(password))),
    ):
        if not is_there:
            raise PeerClosed(f"the server's answer contains no valid {part}")
    kept = _kept([*found.all("candidate")], hosts)
    starts_tls = setup == "active"
    is_lite = found.has("ice-lite")
    return WhepAnswer(user, password, is_lite, fingerprints, starts_tls, codecs, kept)


def _sections(lines: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Return the lines of the session, and those of each medium."""
    session: list[str] = []
    media: list[list[str]] = []
    for line in lines:
        if line.startswith("m="):
            media.append([])
        (media[-1] if media else session).append(line)
    return session, media


class _Attributes:
    """The attributes of some lines, ``a=NAME`` or ``a=NAME:VALUE``."""

    def __init__(self, lines: Sequence[str]) -> None:
        self._pairs = [line[2:].partition(":")[::2] for line in lines if line.startswith("a=")]

    def all(self, name: str) -> Iterator[str]:
        return (value.strip() for other, value in self._pairs if other == name)

    def first(self, name: str) -> str:
        return next(self.all(name), "")

    def has(self, name: str) -> bool:
        return any(other == name for other, _ in self._pairs)


def _codecs(video: Sequence[str]) -> tuple[tuple[int, bool], ...]:
    """Return the payload types with a supported codec; empty if the video is refused."""
    head = video[0].split()
    if len(head) < 4 or head[1] == "0":
        return ()
    found = []
    for value in _Attributes(video).all("rtpmap"):
        number, _, codec = value.partition(" ")
        is_hevc = _CODECS.get(codec.strip().upper())
        if is_hevc is not None and number in head[3:] and number.isdecimal() and len(number) < 4:
            found.append((int(number), is_hevc))
    return tuple(found)


def _fingerprints(found: _Attributes) -> Iterator[tuple[str, str]]:
    for value in found.all("fingerprint"):
        if match := _FINGERPRINT.fullmatch(value):
            yield match[1].lower(), match[2].upper()


def _kept(values: Sequence[str], hosts: Sequence[str]) -> tuple[IceHost, ...]:
    """Return the candidates that are addresses of the camera."""
    permitted = {unmapped(ipaddress.ip_address(host)) for host in hosts}
    found, others = [], []
    for value in values:
        match = _CANDIDATE.fullmatch(value)
        if match is None:
            continue  # TCP, or RTCP without rtcp-mux
        address, port = _address(match["host"]), int(match["port"])
        if address in permitted and 0 < port < 65536:
            priority = int(match["priority"])
            found.append(IceHost(str(address), port, priority, match["foundation"]))
        elif address not in permitted:
            others.append(place_of(one_line(match["host"], 60), port))
    if found:
        return tuple(found[:MAX_CANDIDATES])
    shown = ", ".join(others[:_SHOWN_HOSTS]) or "no address for UDP"
    raise PeerClosed(
        f"the server's answer names {shown}, but URC sends only to {hosts[0]}:"
        " add this address to the server's WebRTC addresses"
    )


def _address(text: str) -> Address | None:
    """Return an IP address; None for a name, which URC does not look up."""
    try:
        return unmapped(ipaddress.ip_address(text))
    except ValueError:
        return None
