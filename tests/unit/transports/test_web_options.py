"""The options of http and websocket: what people read, and one line for whatever is wrong."""

import pytest

from urc.transports.base import TopicSubscription, TransportError, TransportSetup
from urc.transports.http_streams import streams_of
from urc.transports.table import TRANSPORTS

ADDRESSES = [
    ("http", "http://robot.local", "http http://robot.local:80/"),
    ("http", "https://10.0.0.1/api?key=1", "http https://10.0.0.1:443/api?key=1"),
    ("http", " http://[fe80::1]:81/x ", "http http://[fe80::1]:81/x"),
    ("websocket", "ws://robot.local/control", "websocket ws://robot.local:80/control"),
    ("websocket", "wss://robot.local", "websocket wss://robot.local:443/"),
]

URL = "url must be a URL such as http://192.168.4.1/, not"
WRONG: list[tuple[str, dict[str, object], str]] = [
    ("http", {}, f"http: {URL} ''"),
    ("http", {"url": "robot"}, f"http: {URL} 'robot'"),
    ("http", {"url": "ws://robot"}, f"http: {URL} 'ws://robot'"),
    ("http", {"url": "http://"}, f"http: {URL} 'http://'"),
    ("http", {"url": "http://a:99999"}, f"http: {URL} 'http://a:99999'"),
    ("http", {"url": "http://a:0"}, f"http: {URL} 'http://a:0'"),
    ("http", {"url": "http://a/#x"}, f"http: {URL} 'http://a/#x'"),
    ("http", {"url": "http://a b/"}, f"http: {URL} 'http://a b/'"),
    ("http", {"url": 5}, "http: url must be text, not 5"),
    (
        "http",
        {"url": "http://me:secret@robot"},
        "http: put user and password under auth, not in the url",
    ),
    (
        "websocket",
        {"url": "http://a"},
        "websocket: url must be a URL such as ws://192.168.4.1/, not 'http://a'",
    ),
]

BESIDE: list[tuple[dict[str, object], str]] = [
    ({"tls": True}, "http has tls options, but its url does not use TLS"),
    ({"auth": "me"}, "http: auth must be a mapping, not 'me'"),
    ({"auth": {"type": "magic"}}, "http: type must be basic, bearer or digest, not 'magic'"),
    ({"auth": {"type": "bearer"}}, "http: the token of auth is empty: fill in its setting"),
    ({"auth": {"type": "basic"}}, "http: the user of auth is empty: fill in its setting"),
    ({"headers": {"X Y": "z"}}, "http cannot send the header 'X Y'"),
    ({"headers": {"X": "a\nHost: b"}}, "http cannot send the header 'X'"),
    ({"headers": {"Host": "b"}}, "http: a document may not set the header Host"),
    *(
        ({"headers": {name: "x"}}, f"http: a document may not set the header {name}")
        for name in (
            "Origin",
            "cookie",
            "Forwarded",
            "X-Forwarded-For",
            "x-forwarded-host",
            "X-Real-IP",
            "SEC-Fetch-Site",
            "Sec-WebSocket-Key",
            "Proxy-Authorization",
            "Referer",
        )
    ),
    ({"max_body": 0}, "http: max_body must be from 1 to 2.68435e+08, not 0"),
    ({"in_flight": True}, "http: in_flight must be a number, not True"),
    ({"response_timeout": "soon"}, "http: response_timeout must be from 0.05s to 600s, not 'soon'"),
    ({"response_timeout": "20m"}, "http: response_timeout must be from 0.05s to 600s, not '20m'"),
]


@pytest.mark.parametrize(("kind", "url", "address"), ADDRESSES)
def test_address_is_for_people(kind: str, url: str, address: str) -> None:
    """With the port, also where it is the usual one."""
    assert TRANSPORTS[kind].load()(TransportSetup("web", {"url": url})).address == address


@pytest.mark.parametrize(("kind", "options", "message"), WRONG)
def test_unusable_url_is_one_line(kind: str, options: dict[str, object], message: str) -> None:
    """Found when the transport is made, not when it is opened."""
    with pytest.raises(TransportError) as told:
        TRANSPORTS[kind].load()(TransportSetup("web", options))
    assert str(told.value) == message


@pytest.mark.parametrize(("options", "message"), BESIDE)
def test_unusable_options_are_one_line(options: dict[str, object], message: str) -> None:
    """The value of a header, which may be a secret, is not shown."""
    with pytest.raises(TransportError) as told:
        TRANSPORTS["http"].load()(TransportSetup("web", {"url": "http://robot", **options}))
    assert str(told.value) == message


def test_events_of_one_path_share_a_stream() -> None:
    """Each path is asked for once, whoever listens to what of it."""
    found = streams_of(
        [
            TopicSubscription("/events#battery", {"stream": "sse"}),
            TopicSubscription("/events", {"stream": "sse"}),
            TopicSubscription("/cam", {"stream": "mjpeg"}),
        ]
    )
    assert [(one.kind, one.path) for one in found] == [("sse", "/events"), ("mjpeg", "/cam")]
    assert found[0].topics == {"/events#battery", "/events"}


STREAMS: list[tuple[list[TopicSubscription], str]] = [
    (
        [TopicSubscription("/cam")],
        "http: 'stream' of '/cam' must be mjpeg, stills, sse or lines, not None",
    ),
    (
        [TopicSubscription("/cam#x", {"stream": "mjpeg"})],
        "http supports named events only in streams of type sse: '/cam#x'",
    ),
    (
        [TopicSubscription("/s", {"stream": "stills", "every": 0.001})],
        "http: 'every' of '/s' must be from 10ms to 1h, not 0.001",
    ),
    (
        [
            TopicSubscription("/s#a", {"stream": "sse"}),
            TopicSubscription("/s", {"stream": "lines"}),
        ],
        "http cannot open '/s' as two different streams",
    ),
    (
        [TopicSubscription(f"/{n}", {"stream": "lines"}) for n in range(17)],
        "http supports at most 16 streams",
    ),
]


@pytest.mark.parametrize(("subscriptions", "message"), STREAMS)
def test_unusable_subscription_is_one_line(
    subscriptions: list[TopicSubscription], message: str
) -> None:
    """Found when the transport is made."""
    with pytest.raises(TransportError) as told:
        streams_of(subscriptions)
    assert str(told.value) == message
