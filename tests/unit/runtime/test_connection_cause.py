"""The cause of a failed connection, found in the error messages of all transports."""

import errno
import os
import re
import socket
from pathlib import Path
from typing import get_args

import pytest

from urc.runtime.connection_cause import CAUSES, Cause, advice_on, cause_of
from urc.transports._faults import broke, explain, late

SCRIPT = Path(__file__).resolve().parents[3] / "urc/web/static/core/connection_causes.js"


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused"), "refused"),
        (OSError(errno.EHOSTUNREACH, os.strerror(errno.EHOSTUNREACH)), "unreachable"),
        (OSError(errno.ENETUNREACH, os.strerror(errno.ENETUNREACH)), "unreachable"),
        (TimeoutError(), "timeout"),
        (socket.gaierror(socket.EAI_NONAME, "Name or service not known"), "name"),
        (OSError(errno.EPERM, "something new"), ""),
    ],
)
def test_errors_of_sockets(fault: OSError, cause: str) -> None:
    assert cause_of(explain("tls-box", "tls-box:9", fault), "tcp tls-box:9") == cause


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        (late("10.0.0.5:9", 3.0), "timeout"),
        (broke(ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")), "closed"),
        ("the robot closed the connection", "closed"),
        ("permission denied (publickey)", "sign-in"),
        ("10.0.0.5:1883 refuses the connection (not authorized)", "sign-in"),
        ("HTTP 401: unauthorised", "sign-in"),
        ("the certificate of 10.0.0.5:443 is not valid for this name", "tls"),
        ("no TLS connection to 10.0.0.5:443 (wrong version number)", "tls"),
        ("the host key of 10.0.0.5:22 is unknown: found SHA256:x", "host-key"),
        ("no such file or directory", "device"),
        ("nothing received for 5 s; reconnecting", "silent"),
        ("connected; the on_connect steps are not complete yet", "login"),
        ("no answer from 10.0.0.5:4030", "timeout"),
        ("no such host 'login.local'", "name"),
        ("an unusual failure", ""),
    ],
)
def test_messages_of_transports(text: str, cause: str) -> None:
    assert cause_of(text) == cause


def test_a_serial_port_has_permissions_of_its_own() -> None:
    text = "/dev/ttyUSB0: permission denied"
    assert cause_of(text, "serial /dev/ttyUSB0") == "permission"
    assert cause_of(text, "ssh 10.0.0.5:22") == "sign-in"


def test_each_failure_comes_with_advice() -> None:
    assert "check the port" in advice_on("nothing listens on a:80 (connection refused)")
    assert "robot's network" in advice_on("the network is unreachable")
    assert advice_on("unheard of") == "check the settings of this transport"
    assert all(one.advice and one.words for one in CAUSES)


def test_pages_have_words_for_each_cause() -> None:
    named = set(re.findall(r'^  "?([a-z-]+)"?: \{', SCRIPT.read_text("utf-8"), re.MULTILINE))
    assert {one.cause for one in CAUSES} == {*get_args(Cause)} - {""}
    assert {one.cause for one in CAUSES} <= named
