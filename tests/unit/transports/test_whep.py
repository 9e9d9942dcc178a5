"""WHEP without sockets: options, the offer, the checks of an answer, the permitted addresses."""

import ipaddress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.transports import camera
from urc.transports.base import (
    ConnectFailed,
    MissingPackage,
    PeerClosed,
    Transport,
    TransportError,
    TransportSetup,
)
from urc.transports.whep_exchange import WhepEnds, ends_at
from urc.transports.whep_sdp import IceHost, WhepAnswer, offer_text, read_answer

HASH = ":".join(["AB"] * 32)
ANSWER = f"""\
v=0
o=- 1 1 IN IP4 0.0.0.0
s=-
t=0 0
a=group:BUNDLE 0
a=ice-lite
m=video 9 UDP/TLS/RTP/SAVPF 102 106
c=IN IP4 0.0.0.0
a=mid:0
a=sendonly
a=rtcp-mux
a=setup:passive
a=ice-ufrag:abCD
a=ice-pwd:{"x" * 22}
a=fingerprint:sha-256 {HASH}
a=rtpmap:102 H264/90000
a=fmtp:102 packetization-mode=1
a=rtpmap:106 H265/90000
a=rtpmap:120 VP8/90000
a=candidate:1 1 udp 2130706431 192.168.1.5 8189 typ host
a=candidate:2 1 UDP 2130706430 172.17.0.2 8189 typ host generation 0
a=candidate:3 1 tcp 1671430143 192.168.1.5 8189 typ host tcptype passive
a=candidate:4 1 udp 2130706430 0f0f.local 8189 typ host
a=candidate:5 1 udp 1694498815 203.0.113.9 443 typ srflx raddr 0.0.0.0 rport 0
a=end-of-candidates
"""
HOST = "192.168.1.5"
LATE = "add this address to the server's WebRTC addresses"


def made(**options: object) -> Transport:
    return camera.from_setup(TransportSetup("eye", options))


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("whep://10.0.0.2:8889/front/whep", "camera whep://10.0.0.2:8889/front/whep"),
        ("whep://cam.local/front/whep", "camera whep://cam.local:80/front/whep"),
        ("wheps://cam.local/api?src=a", "camera wheps://cam.local:443/api?src=a"),
    ],
)
def test_the_address_is_shown_with_its_port(url: str, shown: str) -> None:
    auth = {"type": "bearer", "token": "t"}
    assert made(url=url).address == made(url=url, auth=auth).address == shown


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"url": "whep://u:p@a/x"}, "camera: put user and password under auth"),
        ({"url": "whep://a/x", "rtp": "udp"}, "camera: rtp has an effect only with an rtsp:// url"),
        ({"url": "whep://a/x", "host": "b"}, "camera: host has an effect only with a udp:// url"),
        ({"url": "whep://a/x", "tls": True}, "camera has tls options, but its url does not use"),
        ({"url": "http://a/x/whep"}, "camera: for WHEP, url must begin with whep://"),
        ({"url": "https://a/x/whep"}, "camera: for WHEP, url must begin with wheps://"),
        ({"url": "whep:///x"}, "camera: url must be a URL such as whep://192.168.4.1/"),
        ({"url": "whep://a/x", "auth": {"type": "bearer"}}, "camera: the token of auth is empty"),
        (
            {"url": "rtsp://a/x", "auth": {"type": "bearer", "token": "t"}},
            "camera: auth with a token has no effect with an rtsp:// url",
        ),
    ],
)
def test_an_invalid_option_is_named(options: dict[str, object], said: str) -> None:
    with pytest.raises(TransportError) as told:
        made(**options)
    assert str(told.value).startswith(said)


def test_a_missing_library_is_named_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "find_spec", lambda name: None if name == "aiortc" else object())
    made(url="rtsp://10.0.0.2/")
    with pytest.raises(MissingPackage) as told:
        made(url="whep://10.0.0.2/")
    assert str(told.value).startswith("camera with WHEP needs the package aiortc: ")


# The offer


def test_the_offer_receives_one_video_and_sends_nothing() -> None:
    text = offer_text(
        user="abCD",
        password="x" * 22,
        fingerprints=[("sha-256", HASH)],
        candidates=["1 1 udp 2130706431 192.168.1.9 40000 typ host"],
    )
    lines = text.split("\r\n")
    assert lines[-1] == ""
    assert [line for line in lines if line.startswith("m=")] == [
        "m=video 9 UDP/TLS/RTP/SAVPF 102 103 104 105 106"
    ]
    assert "a=recvonly" in lines
    assert "a=candidate:1 1 udp 2130706431 192.168.1.9 40000 typ host" in lines
    assert sum(line.endswith(" H264/90000") for line in lines) == 4
    assert "a=rtpmap:106 H265/90000" in lines
    assert "a=rtcp-fb:106 nack pli" in lines


# The answer


def test_an_answer_is_read() -> None:
    assert read_answer(ANSWER, [HOST]) == WhepAnswer(
        user="abCD",
        password="x" * 22,
        is_lite=True,
        fingerprints=(("sha-256", HASH),),
        starts_tls=False,
        codecs=((102, False), (106, True)),
        hosts=(IceHost(HOST, 8189, 2_130_706_431, "1"),),
    )


def test_only_addresses_of_the_camera_are_kept() -> None:
    """No other address, no name that would be looked up, and no TCP."""
    hosts = read_answer(ANSWER, [HOST, "172.17.0.2"]).hosts
    assert [one.address for one in hosts] == [HOST, "172.17.0.2"]
    with pytest.raises(PeerClosed) as told:
        read_answer(ANSWER, ["10.0.0.1"])
    assert str(told.value) == (
        "the server's answer names 192.168.1.5:8189, 172.17.0.2:8189, 0f0f.local:8189,"
        f" but URC sends only to 10.0.0.1: {LATE}"
    )


def test_an_address_in_another_notation_is_the_same() -> None:
    text = ANSWER.replace(" 192.168.1.5 8189", " ::ffff:192.168.1.5 8189")
    assert read_answer(text, [HOST]).hosts[0].address == HOST


def test_many_candidates_are_bounded() -> None:
    line = "a=candidate:1 1 udp 1 192.168.1.5 {} typ host\n"
    text = ANSWER + "".join(line.format(port) for port in range(1000, 2000))
    assert len(read_answer(text, [HOST]).hosts) == 20


NO_CODEC = "the server sends neither H.264 nor H.265"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (ANSWER, "", "the answer is not SDP, but begins with ''"),
        ("v=0", "<html>", "the answer is not SDP, but begins with '<html>"),
        ("m=video", "m=audio", "the server's answer contains no video"),
        ("m=video 9", "m=video 0", NO_CODEC),
        ("SAVPF 102 106", "SAVPF 120", NO_CODEC),
        ("H264", "VP9", None),
        ("a=sendonly", "a=inactive", NO_CODEC),
        ("a=sendonly", "a=recvonly", NO_CODEC),
        ("a=rtcp-mux", "", "the server's answer contains no valid rtcp-mux"),
        ("sha-256", "md5", "the server's answer contains no valid fingerprint"),
        ("setup:passive", "setup:actpass", "the server's answer contains no valid setup"),
        ("a=ice-ufrag:abCD", "", "the server's answer contains no valid ice-ufrag"),
        ("a=ice-pwd:x", "a=ice-pwd:€", "the server's answer contains no valid ice-pwd"),
        ("192.168.1.5 8189 typ", "192.168.1.5 0 typ", "the server's answer names 172.17.0.2:8189"),
        ("a=candidate", "a=other", "the server's answer names no address for UDP, but URC sends"),
    ],
)
def test_an_unsuitable_answer_is_one_line(old: str, new: str, said: str | None) -> None:
    text = ANSWER.replace(old, new)
    assert text != ANSWER
    if said is None:
        assert read_answer(text, [HOST]).codecs == ((106, True),)
        return
    with pytest.raises(PeerClosed) as told:
        read_answer(text, [HOST])
    assert str(told.value).startswith(said)
    assert "\n" not in str(told.value)


def result(text: str) -> WhepAnswer | str:
    """Return an answer, or why it is refused."""
    try:
        return read_answer(text, [HOST])
    except PeerClosed as told:
        return str(told)


@given(st.text())
def test_any_text_is_an_answer_or_one_line(text: str) -> None:
    found = result("v=0\n" + text)
    assert not isinstance(found, str) or "\n" not in found


@given(st.integers(0, ANSWER.count("\n") - 1), st.text(max_size=30))
def test_any_line_of_an_answer_may_be_anything(place: int, text: str) -> None:
    lines = ANSWER.splitlines()
    lines[place] = lines[place][:12] + text
    found = result("\n".join(lines))
    if isinstance(found, str):
        assert "\n" not in found
    else:
        assert {one.address for one in found.hosts} == {HOST}


# The permitted addresses


def test_only_the_address_of_the_http_connection_is_permitted() -> None:
    assert ends_at("192.168.1.9", HOST, ()) == WhepEnds((HOST,), ("192.168.1.9",))
    assert ends_at("::ffff:192.168.1.9", f"::ffff:{HOST}", ()) == WhepEnds(
        (HOST,), ("192.168.1.9",)
    )


def test_a_server_on_this_computer_has_all_addresses_of_this_computer() -> None:
    near = [ipaddress.ip_address(one) for one in ("192.168.1.9", "fe80::1", "fd00::2")]
    own = ("127.0.0.1", "192.168.1.9", "fd00::2")
    assert ends_at("127.0.0.1", "127.0.0.1", near) == WhepEnds(own, own)


def test_loopback_is_this_computer_and_a_documentation_address_is_not() -> None:
    assert ends_at("127.0.0.1", "127.0.0.1").hosts[0] == "127.0.0.1"
    assert ends_at("198.51.100.1", "198.51.100.2").hosts == ("198.51.100.2",)


def test_a_link_local_address_is_refused_with_the_way_out() -> None:
    with pytest.raises(ConnectFailed, match=r"^WHEP cannot use the link-local address fe80::1%lo"):
        ends_at("fe80::2%lo", "fe80::1%lo", ())
