"""What becomes of the last bytes to a serial port when it is closed."""

from pathlib import Path

import pytest

from tests.e2e.transports.test_serial import cable, line, opened, says_back
from urc.transports._serial_port import SerialStream

pytestmark = [pytest.mark.anyio, pytest.mark.needs("socat")]


async def test_closing_makes_the_system_forget_nothing_that_it_has_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pseudo terminal drops then what it has not handed on yet, and counts as sent."""
    forgotten: list[str] = []
    monkeypatch.setattr(SerialStream, "_forget_unsent", lambda _: forgotten.append("all"))
    async with cable(tmp_path) as port, opened(line(port)) as transport:
        await says_back(transport, b"last words")
        await transport.close()
    assert forgotten == []
