"""The examples of docs/api.md run, and print what the page shows."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.api_server import ApiServer, started
from tests.e2e.processes import ROOT, UrcProcess

PAGE = (ROOT / "docs" / "api.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
EXAMPLES = [
    (kind, text, after[1] if after[0] == "json" else "")
    for (kind, text), after in zip(BLOCKS, [*BLOCKS[1:], ("", "")], strict=True)
    if kind in ("sh", "python")
]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiServer]:
    """A server with the robot of the page."""
    folder = tmp_path_factory.mktemp("page")
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
    return server.token("maintain@cart")[1]


def shape(value: object) -> object:
    """Return keys and types; a list has the shape of its first item."""
    if isinstance(value, dict):
        return {key: shape(one) for key, one in value.items()}
    if isinstance(value, list):
        return [shape(one) for one in value[:1]]
    return "number" if type(value) in (int, float) else type(value).__name__


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 6


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_an_example_of_the_page_works(
    number: int, server: ApiServer, token: str, tmp_path: Path
) -> None:
    """It ends without a fault, and its last line has the shape of the page."""
    kind, text, shown = EXAMPLES[number]
    text = text.replace("http://127.0.0.1:8080", server.address.rstrip("/"))
    text = text.replace("TOKEN", token)
    command = [sys.executable, "-"] if kind == "python" else ["bash", "-e", "-u"]
    done = subprocess.run(
        command,
        input=text,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    if "stream" in text:
        assert 'event: values\ndata: {"time":' in done.stdout
    if shown:
        printed = re.findall(r"\{.*\}(?=\{|$)", done.stdout.replace("}{", "}\n{"), re.MULTILINE)
        assert shape(json.loads(printed[-1])) == shape(json.loads(shown))
