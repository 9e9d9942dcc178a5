"""`urc discover`: what announces itself, and what a rosbridge publishes as a document."""

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from zeroconf import ServiceInfo
from zeroconf.asyncio import AsyncZeroconf

from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.ros_bases import STAMPED, TOPICS, open_base
from urc.config.load import load_profile
from urc.runtime.discover import RosTopic, ros_topics, snippet
from urc.runtime.registries import built_in_catalog
from urc.simulator.server import serve
from urc.transports.base import ConnectFailed, TransportSetup
from urc.transports.discover_mdns import ServiceAnnouncement, announced
from urc.transports.discover_serial import serial_ports
from urc.transports.ros.choice import from_setup

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
LOOPBACK = ["127.0.0.1"]
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings: { port: { type: port, default: 9090 } }
discovery: { mdns: [_rosbridge._tcp] }
transports:
  ros: { type: ros, host: 127.0.0.1, port: "{{ settings.port }}" }
"""
ODOMETRY = """
signals: { x: {} }
messages:
  odom: { subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  lamp: { subscribe: { topic: /lamp, type: std_msgs/Bool }, json: { _on: data } }
"""


@asynccontextmanager
async def service(kind: str, name: str, port: int) -> AsyncIterator[None]:
    """Announce a service on loopback alone."""
    info = ServiceInfo(
        f"{kind}.local.",
        f"{name}.{kind}.local.",
        addresses=[socket.inet_aton("127.0.0.1")],
        port=port,
        server="rover.local.",
    )
    zeroconf = AsyncZeroconf(interfaces=LOOPBACK)
    try:
        await (await zeroconf.async_register_service(info))
        yield
    finally:
        await zeroconf.async_close()


async def test_announced_services_are_found_with_their_place() -> None:
    """Of the types that were asked for, and no others."""
    async with (
        nothing_left(),
        service("_rosbridge._tcp", "rover seven", 9090),
        service("_http._tcp", "printer", 80),
    ):
        found = await announced(["_rosbridge._tcp"], 1.5, LOOPBACK)
    assert found == [ServiceAnnouncement("_rosbridge._tcp", "rover seven", "127.0.0.1", 9090)]


async def test_listening_for_what_nobody_announces_ends_in_its_time() -> None:
    """With nothing, and nothing left behind."""
    async with nothing_left(), asyncio.timeout(WAIT_S):
        assert await announced(["_urc-nobody._tcp"], 0.3, LOOPBACK) == []


def test_serial_ports_are_listed_usb_first() -> None:
    """Whatever this machine has: each is a device, each USB device has its ids."""
    ports = serial_ports()
    assert ports == sorted(ports, key=lambda port: (not port.usb, port.device))
    for port in ports:
        assert port.device
        assert port.usb == "" or len(port.usb) == 9


async def test_topics_of_a_bridge_come_with_a_document_that_reads_them(tmp_path: Path) -> None:
    """The proposal is put into the profile as it is, which then has no finding."""
    robot = tmp_path / "robot.yaml"
    robot.write_text(ROVER + ODOMETRY)
    profile = load_profile(robot, built_in_catalog())
    async with nothing_left(), serve(profile, {"port": 0}) as listening:
        port = listening["ros"].port
        transport = from_setup(TransportSetup("ros", {"host": "127.0.0.1", "port": port}))
        topics = await ros_topics(transport, 3.0)
        told = await discover(str(robot), "--json", "--for", "100ms", "--set", f"port={port}")
    assert topics == [RosTopic("/lamp", "std_msgs/Bool"), RosTopic("/odom", "nav_msgs/Odometry")]
    rows = [json.loads(line) for line in told.splitlines()]
    assert [
        (row["found"], row["place"], row["what"]) for row in rows if row["found"] == "topic"
    ] == [
        ("topic", "/lamp", "std_msgs/Bool"),
        ("topic", "/odom", "nav_msgs/Odometry"),
    ]
    robot.write_text(ROVER + snippet(topics, "ros"))
    read = load_profile(robot, built_in_catalog()).driver
    assert read.signals["odom_speed"].unit == "m/s"
    assert read.signals["lamp"].type == "boolean"
    assert list(read.messages) == ["lamp", "odom"]


async def test_a_bridge_of_this_machine_is_found_without_a_profile(tmp_path: Path) -> None:
    """Where shipped robots have it by default; so are other ports on which something listens."""
    robot = tmp_path / "robot.yaml"
    robot.write_text(ROVER + ODOMETRY)
    profile = load_profile(robot, built_in_catalog())
    async with nothing_left(), serve(profile, {"port": 0}) as listening:
        port = listening["ros"].port
        told = await discover("--json", "--for", "100ms", "--set", f"port={port}")
        shown = await discover("--for", "100ms", "--set", f"port={port}")
    rows = [json.loads(line) for line in told.splitlines()]
    found = {(row["found"], row["place"]): row["what"] for row in rows}
    assert "generic-ros1" in found["port", f"127.0.0.1:{port}"]
    assert found["topic", "/odom"] == "nav_msgs/Odometry"
    assert [row["place"] for row in rows if row["found"] == "topic"] == ["/lamp", "/odom"]
    assert 'subscribe: { topic: "/odom", type: nav_msgs/Odometry' in shown


async def test_what_nothing_listens_on_is_not_told() -> None:
    """No line about what could have been there."""
    told = await discover("--json", "--for", "100ms", "--set", f"port={free_port()}", expects=None)
    assert not [line for line in told.splitlines() if json.loads(line)["found"] == "port"]


def test_topic_whose_name_is_none_gets_into_no_document() -> None:
    """A bridge may answer anything; what is printed is put into a profile."""
    names = ['/x", type: a/B }\n  evil: {', "/x\x1b[2J", "/ä", ""]
    assert snippet([RosTopic(name, "std_msgs/Bool") for name in names], "ros") == ""
    assert '"/ns/~x_1"' in snippet([RosTopic("/ns/~x_1", "std_msgs/Bool")], "ros")


async def test_bridge_that_is_not_there_is_told() -> None:
    """As by any other line."""
    transport = from_setup(TransportSetup("ros", {"host": "127.0.0.1", "port": 1}))
    with pytest.raises(ConnectFailed, match="nothing listens on"):
        await ros_topics(transport, 1.0)


async def discover(*arguments: str, expects: int | None = 0) -> str:
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "urc.cli.main", "discover", *arguments, stdout=asyncio.subprocess.PIPE
    )
    said, _ = await asyncio.wait_for(process.communicate(), WAIT_S)
    assert expects is None or process.returncode == expects
    return said.decode()


async def test_topics_are_listed_over_each_kind_of_connection(tmp_path: Path) -> None:
    """From the command line, with a profile that has no messages yet."""
    text = ROVER.replace('port: "{{', 'via: zenoh, port: "{{')
    file = tmp_path / "rover.yaml"
    file.write_text(text)
    async with open_base("zenoh", tmp_path) as base:
        said = await discover(str(file), "--set", f"port={base.port}", "--json", "--for", "100ms")
    found = {row["place"]: row["what"] for row in map(json.loads, said.splitlines())}
    assert TOPICS.items() <= found.items()
    assert found["/cmd_vel"] == STAMPED
