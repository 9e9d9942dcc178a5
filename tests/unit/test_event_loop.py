"""Which loop runs: the fast one where it is installed, else Python's own."""

import asyncio
import sys
from types import ModuleType

import pytest

from urc import _event_loop


async def _kind() -> str:
    return type(asyncio.get_running_loop()).__name__


class _Fast(asyncio.SelectorEventLoop):
    """Stands for the fast one."""


def test_the_fast_loop_runs_where_it_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    uvloop = ModuleType("uvloop")
    uvloop.new_event_loop = _Fast  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "uvloop", uvloop)
    assert _event_loop.run(_kind()) == "_Fast"


def test_pythons_own_runs_where_it_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvloop", None)
    assert _event_loop.run(_kind()) == asyncio.run(_kind())
