"""The whole HTTP API under a fuzzer: no server error, and no answer beyond the right.

Each run tries every call by one visitor; ``URC_THOROUGH=1`` tries every call by all visitors, with
many more requests.
"""

from collections.abc import Iterator
from itertools import cycle, islice, product
from typing import Any, Final

import pytest

from tests.e2e.api_fuzzer import FuzzVisitor, fuzzed, operations
from tests.e2e.api_server import ApiServer, started
from tests.e2e.processes import UrcProcess
from tests.effort import IS_THOROUGH, examples, sampled

OPERATIONS: Final[dict[str, Any]] = dict(operations())
EACH: Final = 60 if IS_THOROUGH else 2
"""Requests of each kind and call from one visitor."""
VISITORS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "nobody": ((), ()),
    "a removed token": (("administer",), ()),
    "a token without a role": ((), ()),
    "watch": (("watch",), ()),
    "watch at one robot": (("watch@cart",), ()),
    "drive": (("drive",), ()),
    "drive at a tag": (("drive@#lab",), ()),
    "drive with one command": (("drive",), ("echo",)),
    "maintain": (("maintain",), ()),
    "maintain at one robot": (("maintain@other", "watch@cart"), ()),
}
"""Grants and commands of each visitor."""


def pairs() -> list[tuple[str, str]]:
    """Return pairs of visitor and call: each call once, or with each visitor in a thorough run."""
    if IS_THOROUGH:
        return list(product(VISITORS, OPERATIONS))
    first = sampled(range(len(VISITORS)), 1)[0]
    following = islice(cycle(VISITORS), first, None)
    return list(zip(following, OPERATIONS, strict=False))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiServer]:
    """One server for the whole fuzzer."""
    folder = tmp_path_factory.mktemp("fuzz")
    processes: list[UrcProcess] = []

    def start(*arguments: str) -> UrcProcess:
        processes.append(UrcProcess(arguments, {}))
        return processes[-1]

    try:
        yield started(start, folder, "--record", str(folder / "recordings"))
    finally:
        for process in processes:
            process.kill()


@pytest.fixture(scope="module")
def administrator(server: ApiServer) -> FuzzVisitor:
    _, token = server.token("administer")
    return FuzzVisitor({"authorization": f"Bearer {token}"}, ("administer",))


def is_sound(server: ApiServer) -> bool:
    """Return whether the server runs, and has printed no fault."""
    return server.process.is_running and not any(
        "Traceback" in line or "ERROR" in line for line in server.process.errors
    )


@pytest.mark.cases(20)
@pytest.mark.parametrize("name", OPERATIONS)
def test_no_request_of_an_administrator_breaks_the_server(
    name: str, server: ApiServer, administrator: FuzzVisitor
) -> None:
    """Requests that fit the document, and others."""
    address = server.address.rstrip("/")
    statuses = fuzzed(name, OPERATIONS[name], address, administrator, examples(120))
    assert sum(statuses.values()) >= 1
    assert is_sound(server)


@pytest.fixture(scope="module")
def visitors(server: ApiServer) -> dict[str, FuzzVisitor]:
    """All visitors, with their tokens."""
    found = {}
    for who, (grants, commands) in VISITORS.items():
        if who == "nobody":
            found[who] = FuzzVisitor({})
            continue
        program, token = server.token(*grants, commands=commands, is_known=bool(grants))
        headers = {"authorization": f"Bearer {token}"}
        found[who] = FuzzVisitor(headers, grants, commands)
        if who == "a removed token":
            server.remove(program, token)
            found[who] = FuzzVisitor(headers)
    return found


@pytest.mark.cases(30)
@pytest.mark.parametrize(("who", "name"), pairs())
def test_no_visitor_gets_an_answer_beyond_its_right(
    who: str, name: str, server: ApiServer, visitors: dict[str, FuzzVisitor]
) -> None:
    """Whatever a visitor sends."""
    address = server.address.rstrip("/")
    statuses = fuzzed(name, OPERATIONS[name], address, visitors[who], EACH)
    assert sum(statuses.values()) >= 1
    assert is_sound(server)
