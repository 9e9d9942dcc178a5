"""The whole HTTP API under a fuzzer: no server error, and only documented answers."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from tests.e2e.api_fuzzer import fuzzed, operations
from tests.e2e.api_server import ApiServer, started
from tests.e2e.processes import UrcProcess
from tests.effort import examples

OPERATIONS = dict(operations())


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
def token(server: ApiServer) -> str:
    return server.token("administer")[1]


@pytest.mark.parametrize("name", OPERATIONS)
def test_no_request_of_an_administrator_breaks_the_server(
    name: str, server: ApiServer, token: str
) -> None:
    """Requests that fit the document, and others."""
    statuses: Counter[int] = Counter()
    operation: Any = OPERATIONS[name]
    headers = {"authorization": f"Bearer {token}"}
    statuses += fuzzed(name, operation, server.address.rstrip("/"), headers, examples(120))
    assert sum(statuses.values()) >= 1
    assert server.process.is_running
    assert not [line for line in server.process.errors if "Traceback" in line]
