"""Completion, hover and findings in an editor: a real YAML language server reads our schemas.

An editor needs nothing of ours but the first line of a document, which names the schema; the
schemas refer to each other by file name, and the server must follow that.
"""

import json
import queue
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest

from scripts.needs import LANGUAGE_SERVER
from scripts.node import node_executable
from urc.config.schemas import KINDS, read_schema

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 100.0

ROBOT = """\
# yaml-language-server: $schema=../schemas/robot.schema.json
urc: 1
kind: robot
name: editor
transports:
  wire:
    type: tcp
    host: robot
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  battery:
    unit: "%"
    presicion: 1
    |
polls:
  - every: 1s
    send: "?"
    |
"""


class LanguageServer:
    """Speaks the Language Server Protocol over standard input and output."""

    def __init__(self, command: list[str]) -> None:
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._messages: queue.Queue[dict[str, Any]] = queue.Queue()
        self._reader = threading.Thread(target=self._read, args=(self._process.stdout,))
        self._reader.start()
        self._last_id = 0
        self.found: dict[str, list[dict[str, Any]]] = {}
        """Findings by the document's address."""

    def request(self, method: str, **params: Any) -> Any:
        """Ask, and return the answer; what the server asks or tells meanwhile is taken care of."""
        self._last_id += 1
        self._send({"id": self._last_id, "method": method, "params": params})
        while True:
            message = self._messages.get(timeout=TIMEOUT_S)
            if message.get("id") == self._last_id and "method" not in message:
                assert "error" not in message, message
                return message["result"]
            self._take(message)

    def tell(self, method: str, **params: Any) -> None:
        """Send a notification."""
        self._send({"method": method, "params": params})

    def problems(self, address: str) -> list[dict[str, Any]]:
        """Return what the server finds in a document, once it has said anything about it."""
        while address not in self.found:
            self._take(self._messages.get(timeout=TIMEOUT_S))
        return self.found[address]

    def close(self) -> None:
        """End the server, whatever state it is in."""
        self._process.kill()
        self._process.wait()
        self._reader.join(timeout=5)
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()

    def _take(self, message: dict[str, Any]) -> None:
        if message.get("method") == "textDocument/publishDiagnostics":
            params = message["params"]
            self.found[params["uri"]] = params["diagnostics"]
        elif "method" in message and "id" in message:
            items = message["params"].get("items", [])
            answer = [SETTINGS if item.get("section") == "yaml" else {} for item in items]
            is_question = message["method"] == "workspace/configuration"
            self._send({"id": message["id"], "result": answer if is_question else None})

    def _send(self, message: dict[str, Any]) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message}).encode()
        stream = self._process.stdin
        assert stream is not None
        stream.write(b"Content-Length: %d\r\n\r\n%b" % (len(data), data))
        stream.flush()

    def _read(self, stream: IO[bytes] | None) -> None:
        assert stream is not None
        size = 0
        for line in stream:
            name, _, value = line.strip().partition(b":")
            if name.lower() == b"content-length":
                size = int(value)
            elif not name:
                self._messages.put(json.loads(stream.read(size)))


SETTINGS = {"validate": True, "hover": True, "completion": True, "schemaStore": {"enable": False}}
CAPABILITIES = {
    "textDocument": {
        "completion": {"completionItem": {"documentationFormat": ["markdown"]}},
        "hover": {"contentFormat": ["markdown"]},
    },
    "workspace": {"configuration": True},
}


@pytest.fixture(scope="module")
def server() -> Iterator[LanguageServer]:
    node = node_executable()
    assert node is not None
    started = LanguageServer([node, str(LANGUAGE_SERVER), "--stdio"])
    try:
        started.request(
            "initialize", processId=None, rootUri=ROOT.as_uri(), capabilities=CAPABILITIES
        )
        started.tell("initialized")
        yield started
    finally:
        started.close()


class Opened:
    """A document as the editor has it, each of its own name; it need not be on the disk.

    Questions come after the first findings, as from a person. Before them, the server confuses its
    copy of the schema, and computes for more than ten seconds.
    """

    _count = 0

    def __init__(self, server: LanguageServer, text: str) -> None:
        Opened._count += 1
        self.server = server
        self.lines = text.splitlines()
        self.address = (ROOT / "robots" / f"editor-{Opened._count}.yaml").as_uri()
        document = {"uri": self.address, "languageId": "yaml", "version": 1, "text": text}
        server.tell("textDocument/didOpen", textDocument=document)
        self.findings = server.problems(self.address)

    def at(self, word: str, nth: int = 0) -> dict[str, Any]:
        """Return the place of the n-th line that has `word`, as the protocol writes it."""
        rows = [row for row, line in enumerate(self.lines) if word in line]
        row = rows[nth]
        position = {"line": row, "character": self.lines[row].index(word)}
        return {"textDocument": {"uri": self.address}, "position": position}

    def completions(self, place: dict[str, Any]) -> dict[str, str]:
        """Return label → documentation."""
        answer = self.server.request("textDocument/completion", **place)
        return {item["label"]: _text(item.get("documentation")) for item in answer["items"]}

    def hover(self, word: str) -> str:
        place = self.at(word)
        place["position"]["character"] += 1
        return _text(self.server.request("textDocument/hover", **place)["contents"])


def _text(documentation: Any) -> str:
    return str(documentation["value"] if isinstance(documentation, dict) else documentation)


def description(pointer: str, file: str = "driver.schema.json") -> str:
    """Return the first sentence of a description in a schema."""
    schema: Any = read_schema(file)
    for part in pointer.split("/"):
        schema = schema[part]
    return str(schema["description"]).partition(".")[0]


@pytest.mark.needs("node")
@pytest.mark.needs("language-server")
def test_empty_line_is_completed_with_the_keys_of_its_place(server: LanguageServer) -> None:
    """The keys of a signal and of a poll, as a schema beside the named one describes them."""
    opened = Opened(server, ROBOT.replace("    |\n", "    \n"))
    rows = [row for row, line in enumerate(opened.lines) if line == "    "]
    offered = []
    for row in rows:
        place = opened.at("urc: 1")
        place["position"] = {"line": row, "character": 4}
        offered.append(opened.completions(place))
    signal, poll = offered
    properties = read_schema("driver.schema.json")["$defs"]["signal"]["properties"]
    assert set(signal) == set(properties) - {"unit"}
    assert description("$defs/signal/properties/min") in signal["min"]
    assert {"phase", "reply", "to"} <= set(poll)
    assert description("$defs/reply") in poll["reply"]


@pytest.mark.needs("node")
@pytest.mark.needs("language-server")
def test_misspelt_key_is_found_and_the_right_one_offered(server: LanguageServer) -> None:
    """Underlined where it stands; completion at its place has the key that was meant."""
    opened = Opened(server, ROBOT.replace("    |\n", ""))
    (finding,) = opened.findings
    assert "presicion" in finding["message"]
    start = opened.at("presicion")["position"]
    assert finding["range"]["start"] == start
    place = opened.at("presicion")
    place["position"]["character"] += 3
    assert (
        description("$defs/signal/properties/precision") in opened.completions(place)["precision"]
    )


@pytest.mark.needs("node")
@pytest.mark.needs("language-server")
def test_hover_tells_what_a_key_is(server: LanguageServer) -> None:
    """What a framing of this type is, with an example, two references away."""
    opened = Opened(server, ROBOT.replace("    |\n", ""))
    hover = opened.hover("framing")
    assert description("$defs/delimiterFraming") in hover or description("$defs/framing") in hover
    assert "type: delimiter" in hover
    assert description("$defs/poll/properties/every") in opened.hover("every")


@pytest.mark.parametrize("kind", KINDS)
def test_shipped_documents_name_their_schema_in_the_first_line(kind: str) -> None:
    """That line is all that an editor needs."""
    folders = {"robot": "robots/*.yaml", "driver": "robots/drivers/*.yaml"}
    folders |= {"interface": "robots/interfaces/*.yaml", "widget": "widgets/*/widget.yaml"}
    for file in ROOT.glob(folders[kind]):
        first = file.read_text("utf-8").partition("\n")[0]
        _, named, schema = first.partition("# yaml-language-server: $schema=")
        assert named, file
        assert (file.parent / schema).resolve() == ROOT / "schemas" / f"{kind}.schema.json"
