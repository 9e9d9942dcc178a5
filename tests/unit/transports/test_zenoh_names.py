"""Keys, tokens and attachments of rmw_zenoh, as its design document shows them."""

import xxhash
from zenoh import ZBytes
from zenoh.ext import Int64, z_deserialize, z_serialize

from urc.transports.ros.zenoh_names import (
    NodeNames,
    attachment,
    source_time,
    token_of,
    tokens_key,
    topic_key,
    topic_keys,
    type_of_key,
)

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
LISTENER = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
SUBSCRIPTION = (
    "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING}/::,10:,:,:,,"
)
PUBLISHER = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
)
SERVICE = (
    "@ros2_lv/2/f9980ee0495eaafb3e38f0d19e2eae12/0/10/SS/%/%/add_two_ints_server/%add_two_ints/"
    "example_interfaces::srv::dds_::AddTwoInts_/"
    "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a/::,10:,:,:,,"
)


def test_keys_are_those_of_the_design_document() -> None:
    """With and without a namespace, and read back."""
    key = f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
    assert topic_key(0, "/chatter", "std_msgs/msg/String", STRING) == key
    assert topic_key(0, "chatter", "std_msgs/String", STRING) == key
    inner = f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"
    assert topic_key(0, "/robot1/chatter", "std_msgs/String", STRING) == inner
    assert topic_keys(7, "/robot1/chatter/") == "7/robot1/chatter/*/*"
    assert type_of_key(inner) == ("std_msgs/msg/String", STRING)
    for other in ("", "a", "0/chatter/odd/hash", "a/b"):
        assert type_of_key(other)[0] == ""


def test_tokens_are_those_of_the_design_document() -> None:
    """Of a node and its subscription, where the counters fit."""
    names = NodeNames(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")
    assert names.node == LISTENER
    for _ in range(9):
        names.topic("MP", "x", "a/B", "")
    assert names.topic("MS", "/chatter", "std_msgs/String", STRING) == SUBSCRIPTION
    assert tokens_key(2) == "@ros2_lv/2/**"


def test_tokens_are_read() -> None:
    """Publishers and subscriptions; nodes, services and anything else are nothing."""
    found = token_of(PUBLISHER)
    assert found == ("publisher", "/chatter", "std_msgs/msg/String", STRING, False, "/talker")
    assert token_of(SUBSCRIPTION) == found._replace(kind="subscription", node="/listener")
    inner = token_of(PUBLISHER.replace("/%/talker/", "/%robot1%arm/talker/"))
    assert inner is not None
    assert inner.node == "/robot1/arm/talker"
    kept = token_of(PUBLISHER.replace("/::,7:", "/:1:,1:"))
    assert kept is not None
    assert kept.is_transient
    for other in (LISTENER, SERVICE, "", "a/b", PUBLISHER + "/more", PUBLISHER[1:]):
        assert token_of(other) is None


def test_attachment_is_what_the_library_would_write() -> None:
    """33 bytes: two numbers, the length of the identifier, and the identifier."""
    gid = bytes(range(16))
    written = attachment(7, 1_700_000_000_123_456_789, gid)
    assert written == z_serialize((Int64(7), Int64(1_700_000_000_123_456_789), gid)).to_bytes()
    assert len(written) == 33
    number, time_ns, inner = z_deserialize(tuple[Int64, Int64, bytes], ZBytes(written))
    assert (number, time_ns, inner) == (7, 1_700_000_000_123_456_789, gid)
    assert source_time(written) == 1_700_000_000_123_456_789
    assert source_time(None) is None
    assert source_time(b"") is None
    assert source_time(written[:-1]) is None


def test_identifier_is_the_hash_of_the_token() -> None:
    """Low half first, each half in little-endian order; by the algorithm's own test vector."""
    assert xxhash.xxh3_128_hexdigest(b"") == "99aa06d3014798d86001c324468d497f"
    low_first = xxhash.xxh3_128_intdigest(b"").to_bytes(16, "little")
    assert low_first[:8] == (0x6001C324468D497F).to_bytes(8, "little")
