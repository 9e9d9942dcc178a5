"""The tcp row of the transports table; its sockets are tested in tests/e2e."""

import subprocess
import sys

import pytest

from urc.model.values import Value
from urc.transports.base import TransportError, TransportSetup
from urc.transports.table import TRANSPORTS

ADDRESSES = [
    ({"host": "robot.local", "port": 6789}, "tcp robot.local:6789"),
    ({"host": " 10.0.0.1", "port": 1}, "tcp 10.0.0.1:1"),
    ({"host": "fe80::1", "port": 65535}, "tcp [fe80::1]:65535"),
]

WRONG: list[tuple[dict[str, Value], str]] = [
    ({"port": 1}, "tcp: host must be a host name or address, not None"),
    ({"host": " ", "port": 1}, "tcp: host must be a host name or address, not ' '"),
    ({"host": "h"}, "tcp: port must be an integer from 1 to 65535, not None"),
    ({"host": "h", "port": 0}, "tcp: port must be an integer from 1 to 65535, not 0"),
    ({"host": "h", "port": 65536}, "tcp: port must be an integer from 1 to 65535, not 65536"),
    ({"host": "h", "port": "6789"}, "tcp: port must be an integer from 1 to 65535, not '6789'"),
    ({"host": "h", "port": True}, "tcp: port must be an integer from 1 to 65535, not True"),
]


@pytest.mark.parametrize(("options", "address"), ADDRESSES)
def test_address_is_for_people(options: dict[str, Value], address: str) -> None:
    """An IPv6 address stands in brackets."""
    assert TRANSPORTS["tcp"].load()(TransportSetup("wire", options)).address == address


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_unusable_options_are_one_line(options: dict[str, Value], message: str) -> None:
    """Found when the transport is made, not when it is opened."""
    with pytest.raises(TransportError) as told:
        TRANSPORTS["tcp"].load()(TransportSetup("wire", options))
    assert str(told.value) == message


def test_catalog_imports_no_transport() -> None:
    """What only reads documents does not pay for an event loop."""
    code = (
        "import sys; from urc.runtime.registries import built_in_catalog; built_in_catalog();"
        "print(sorted({'asyncio', 'socket', 'urc.transports.tcp'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.stdout, done.stderr) == ("[]\n", "")
