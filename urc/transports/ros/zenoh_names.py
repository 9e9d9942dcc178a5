"""The names of ROS 2 on Zenoh: keys of topics, liveliness tokens and attachments. No I/O.

Each topic of the middleware rmw_zenoh is a Zenoh key with the domain, the topic, its type and the
hash of the type. Each node, publisher and subscription has a liveliness token, which describes it.
Each message has an attachment with a number, a time and the publisher's identifier. Source: the
design document and the sources of rmw_zenoh_cpp, from June 2025 on.
"""

import struct
from typing import Final, NamedTuple

__all__ = [
    "NO_HASH",
    "NodeNames",
    "TopicToken",
    "attachment",
    "dds_type",
    "source_time",
    "token_of",
    "tokens_key",
    "topic_key",
    "topic_keys",
    "type_of_key",
]

NO_HASH: Final = "TypeHashNotSupported"
"""The hash of every type in ROS 2 Humble."""
_ADMIN: Final = "@ros2_lv"
_KINDS: Final = {"MP": "publisher", "MS": "subscription"}
_QOS: Final = "::,10:,:,:,,"
"""Reliable, volatile, the last 10 messages; all other settings are those of rmw_zenoh."""
_TRANSIENT_LOCAL: Final = "1"
_TOKEN_PARTS: Final = 13
_GID_BYTES: Final = 16
_ATTACHMENT: Final = struct.Struct("<qqB16s")


def dds_type(name: str) -> str:
    """Return a type name in the form of rmw_zenoh, such as ``std_msgs::msg::dds_::String_``.

    Args:
        name: ``pkg/Type`` or ``pkg/msg/Type``.
    """
    words = name.split("/")
    return f"{words[0]}::msg::dds_::{words[-1]}_"


def topic_key(domain: int, topic: str, kind: str, hashed: str) -> str:
    """Return the key of a topic with the type `kind` and the hash `hashed`."""
    return f"{domain}/{topic.strip('/')}/{dds_type(kind)}/{hashed}"


def topic_keys(domain: int, topic: str) -> str:
    """Return the key expression of a topic with any type and hash."""
    return f"{domain}/{topic.strip('/')}/*/*"


def type_of_key(key: str) -> tuple[str, str]:
    """Return the type ``pkg/msg/Type`` and the hash in a topic's key; "" for another key."""
    *_, kind, hashed = ("", "", *key.split("/"))
    return _plain(kind), hashed


def _plain(kind: str) -> str:
    words = kind.removesuffix("_").split("::")
    return "/".join(word for word in words if word != "dds_") if len(words) == 4 else ""


class TopicToken(NamedTuple):
    """A publisher or subscription, as described by its token."""

    kind: str
    """``publisher`` or ``subscription``."""
    topic: str
    type: str
    """Type in the form ``pkg/msg/Type``."""
    hashed: str
    is_transient: bool
    """Whether a publisher keeps its last messages for later subscriptions."""
    node: str = ""
    """Name of the node, such as ``/robot1/driver``."""


def tokens_key(domain: int) -> str:
    """Return the key expression of all tokens in a domain."""
    return f"{_ADMIN}/{domain}/**"


def token_of(key: str) -> TopicToken | None:
    """Return the publisher or subscription of a token; None for other tokens."""
    parts = key.split("/")
    if len(parts) != _TOKEN_PARTS or parts[0] != _ADMIN or parts[5] not in _KINDS:
        return None
    topic, kind, hashed, qos = parts[9:]
    durability = (*qos.split(":"), "", "")[1]
    return TopicToken(
        _KINDS[parts[5]],
        topic.replace("%", "/"),
        _plain(kind),
        hashed,
        durability == _TRANSIENT_LOCAL,
        f"{parts[7].replace('%', '/').rstrip('/')}/{parts[8]}",
    )


class NodeNames:
    """The tokens of URC's own node."""

    def __init__(self, domain: int, session: str, name: str) -> None:
        """Create the names for a `session`, which is the identifier of a Zenoh session."""
        self._domain = domain
        self._session = session
        self._name = name
        self._count = 0

    @property
    def node(self) -> str:
        """The token of the node."""
        return f"{_ADMIN}/{self._domain}/{self._session}/0/0/NN/%/%/{self._name}"

    def topic(self, letters: str, topic: str, kind: str, hashed: str) -> str:
        """Return a new token of a publisher (MP) or subscription (MS)."""
        self._count += 1
        mangled = f"/{topic.strip('/')}".replace("/", "%")
        head = f"{_ADMIN}/{self._domain}/{self._session}/0/{self._count}/{letters}/%/%/{self._name}"
        return f"{head}/{mangled}/{dds_type(kind)}/{hashed}/{_QOS}"


def attachment(number: int, time_ns: int, gid: bytes) -> bytes:
    """Return the attachment of a message.

    Args:
        number: number of the message, beginning at 1 for each publisher.
        time_ns: time in nanoseconds since the epoch.
        gid: 16 bytes that identify the publisher.
    """
    return _ATTACHMENT.pack(number, time_ns, _GID_BYTES, gid)


def source_time(data: bytes | None) -> int | None:
    """Return the time in a message's attachment, in nanoseconds; None for other attachments."""
    if data is None or len(data) != _ATTACHMENT.size or data[16] != _GID_BYTES:
        return None
    return int(_ATTACHMENT.unpack(data)[1])
