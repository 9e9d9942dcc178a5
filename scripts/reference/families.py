"""Families of keys: each family is one reference page, and lists the definitions on that page."""

from collections.abc import Mapping
from typing import NamedTuple

__all__ = ["FAMILIES", "Family"]


class Family(NamedTuple):
    """A family of keys, described on one page of the reference."""

    title: str
    summary: str
    definitions: tuple[str, ...]
    """Kinds of documents, such as `robot`, and definitions in schemas, such as `driver:hold`."""
    guides: Mapping[str, str] = {}
    """The pages that explain these keys: path below docs/ and title."""


def _driver(words: str) -> tuple[str, ...]:
    return tuple(f"driver:{word}" for word in words.split())


FAMILIES: Mapping[str, Family] = {
    "documents": Family(
        "Keys of documents",
        "Top-level keys of the documents of robots and drivers, and the types of their values.",
        (
            *("robot", "robot:usedDriver", "robot:inlineDriver", "driver"),
            *_driver(
                "urc documentName title summary licence author tags description identifier"
                " namePattern slotPattern slotName duration unit givenValue scalar text template"
                " option pattern expression transportName discovery"
            ),
        ),
        {"profile.md": "Write a profile"},
    ),
    "reuse": Family(
        "Keys of reuse",
        "Keys for documents that extend, include or repeat other parts.",
        _driver("extends include partial params param each remove reference"),
        {"language/reuse.md": "Reuse"},
    ),
    "settings": Family(
        "Keys of settings",
        "Values that the operator fills in, such as the address of the robot.",
        _driver("settings setting"),
        {"managers.md": "Menu, managers and settings"},
    ),
    "connections": Family(
        "Keys of every transport",
        "Keys that all kinds of connections share: timeouts, reconnection, queue and keepalive.",
        _driver(
            "transports transport anyTransport connection encoding timeouts reconnect minGap queue"
            " keepalive onConnect onClose lineStaleAfter lineDuplex lineHint lineReplies lineErrors"
            " tls tunnel"
        ),
        {"language/flow.md": "Requests, replies and sequences"},
    ),
    "tcp": Family(
        "Keys of tcp transports",
        "Keys of a TCP connection, opened by URC or by the robot.",
        _driver("tcp"),
        {"transports/tcp.md": "TCP"},
    ),
    "udp": Family(
        "Keys of udp transports",
        "Keys of UDP datagrams to and from the robot.",
        _driver("udp"),
        {"transports/udp.md": "UDP"},
    ),
    "serial": Family(
        "Keys of serial transports",
        "Keys of a serial port: baud rate, parity, control lines.",
        _driver("serial"),
        {"transports/serial.md": "Serial lines"},
    ),
    "ros": Family(
        "Keys of ros transports",
        "Keys of a connection to ROS 1 or ROS 2.",
        _driver("ros"),
        {
            "transports/rosbridge.md": "ROS over rosbridge",
            "transports/foxglove.md": "ROS over foxglove_bridge",
            "transports/ros-zenoh.md": "ROS over Zenoh",
        },
    ),
    "mqtt": Family(
        "Keys of mqtt transports",
        "Keys of a connection through an MQTT broker.",
        _driver("mqtt"),
        {"transports/mqtt.md": "MQTT"},
    ),
    "zenoh": Family(
        "Keys of zenoh transports",
        "Keys of a connection to a Zenoh router.",
        _driver("zenoh"),
        {"transports/zenoh.md": "Zenoh"},
    ),
    "http": Family(
        "Keys of http transports",
        "Keys of a robot with a web server, and of HTTP authentication.",
        _driver("http httpAuth httpHeaders"),
        {"transports/http.md": "HTTP"},
    ),
    "camera": Family(
        "Keys of camera transports",
        "Keys of a camera that sends H.264 or H.265.",
        _driver("camera cameraStreams cameraAuth"),
        {"transports/camera.md": "Cameras with H.264"},
    ),
    "websocket": Family(
        "Keys of websocket transports",
        "Keys of a WebSocket to the robot.",
        _driver("websocket"),
        {"transports/websocket.md": "WebSocket"},
    ),
    "ssh": Family(
        "Keys of ssh transports",
        "Keys of a connection to an SSH server: shell, command or tunnel.",
        _driver("ssh"),
        {"transports/ssh.md": "SSH"},
    ),
    "telnet": Family(
        "Keys of telnet transports",
        "Keys of a connection to a Telnet server.",
        _driver("telnet"),
        {"transports/telnet.md": "Telnet"},
    ),
    "framing": Family(
        "Keys of framing",
        "Keys that define where a frame begins and ends.",
        _driver(
            "framing sendFraming anyFraming delimiterFraming fixedFraming lengthFraming lengthField"
            " payloadWindow slipFraming cobsFraming idleFraming regexFraming bracketsFraming"
            " jsonFraming xmlFraming datagramFraming switchFraming switchCase byteString escape"
            " frameTimeout stripAnsi frameDigits frameMax delimiter"
        ),
        {"language/framing.md": "Framing and checksums"},
    ),
    "checksums": Family(
        "Keys of checksums",
        "Keys of checksums: algorithm, covered bytes, position and format.",
        _driver(
            "checksums checksum checksumAlgorithm algorithmParameters crcAlgorithm foldAlgorithm"
            " checksumOver checksumWindow checksumSalt saltTable"
        ),
        {"language/framing.md": "Framing and checksums"},
    ),
    "signals": Family(
        "Keys of signals",
        "Keys of signals: type, unit, range, conversion and age.",
        _driver(
            "signals signal conversion base scale offset polynomial points states notAvailable"
        ),
        {"language/signals.md": "Signals"},
    ),
    "alarms": Family(
        "Keys of alarms",
        "Keys of limits and alarm states, with priority, cause and operator action.",
        _driver(
            "limits alarmLimit alarmAttributes alarmPriority alarmCause alarmAction alarmCommand"
            " suppressedWhen"
        ),
        {"alarms.md": "Alarms"},
    ),
    "messages": Family(
        "Keys of messages",
        "Keys of frames that the robot sends without a request, and the forms of text frames.",
        _driver(
            "messages message subscribe logLine collect collected fieldPattern splitForm"
            " keyvalueForm jsonForm xmlForm equalsForm rawForm fieldConversions setExpressions"
            " whenExpression lines"
        ),
        {"language/text.md": "Text frames", "language/messages.md": "Messages"},
    ),
    "binary": Family(
        "Keys of binary frames",
        "Keys of structs, bit fields, enumerations and shared types.",
        _driver("structForm structItem longItem branch bitPart itemName types enums enumWords"),
        {"language/binary.md": "Binary and structured frames"},
    ),
    "commands": Family(
        "Keys of commands",
        "Keys of commands: arguments, confirmation, interlocks, priority and retries.",
        _driver("commands command argument priority role rate confirm retries requires verify"),
        {"language/flow.md": "Requests, replies and sequences"},
    ),
    "motion": Family(
        "Keys of motion",
        "Keys of held commands: the robot moves only while the operator holds the control.",
        _driver("hold"),
        {"motion.md": "The motion contract"},
    ),
    "replies": Family(
        "Keys of replies",
        "Keys of replies, error replies and intermediate frames.",
        _driver("reply errorReply asideForm answerHead"),
        {"language/flow.md": "Requests, replies and sequences"},
    ),
    "sending": Family(
        "Keys of sent frames",
        "Keys of the frame or message that a command, poll or step sends.",
        _driver(
            "send sendFrames sendForm publishForm callForm goalForm cancelForm requestForm getForm"
            " jsonBody"
            " textBody hexBody bytesBody"
        ),
        {"language/binary.md": "Binary and structured frames", "language/messages.md": "Messages"},
    ),
    "polls": Family(
        "Keys of polls",
        "Keys of polls, the requests that URC repeats periodically.",
        _driver("polls poll offline"),
        {"language/flow.md": "Requests, replies and sequences"},
    ),
    "sequences": Family(
        "Keys of sequences",
        "Keys of sequences and their steps, for example for a login, a start-up or arming.",
        _driver("sequences sequence steps step waitUntil"),
        {"language/flow.md": "Requests, replies and sequences"},
    ),
    "interfaces": Family(
        "Keys of interfaces",
        "Keys of layouts, tabs and backgrounds, and of the widgets in their slots.",
        (
            *("interface", "interface:inlineInterface", "interface:grid", "interface:layouts"),
            *("interface:left_handed", "interface:mirror", "interface:tabs", "interface:tab"),
            *("interface:background", "interface:drawer", "interface:overrides"),
            *_driver("slots widgetUse commandBinding"),
        ),
        {"interfaces.md": "Interfaces"},
    ),
    "widget-manifest": Family(
        "Keys of widget manifests",
        "Keys of `widget.yaml`, the manifest of a widget.",
        (
            *("widget", "widget:input", "widget:output", "widget:option", "widget:portName"),
            *("widget:unitOf", "widget:inputType", "widget:valueType", "widget:outputType"),
        ),
        {"widgets.md": "Write a widget"},
    ),
    "tests": Family(
        "Keys of tests",
        "Keys of the tests in a document, which `urc validate` runs without a robot.",
        _driver(
            "tests test testStep testBytes testMessage testEnvelope testFeed testSent testExpect"
            " testState"
        ),
        {"language/tests.md": "Tests"},
    ),
    "simulator": Family(
        "Keys of the simulator",
        "Keys of the emulated robot and of its world.",
        _driver(
            "simulator simulatorRule simulatorReaction simulatorMatch simulatorAfter simulatorSet"
            " simulatorAnswer simulatorSend simulatorMessage simulatorFraming simulatorClose"
        ),
        {"language/tests.md": "Tests"},
    ),
    "world": Family(
        "Keys of the world",
        "Keys of an emulated robot's world: body, sensors and fail-safe.",
        _driver("world worldBody worldFailsafe worldMap worldLaser worldCamera worldBattery"),
        {"language/world.md": "The world"},
    ),
}
