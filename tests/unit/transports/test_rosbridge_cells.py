"""Cells of large maps over rosbridge: bytes, decoded in pieces, and what is left as it is."""

import asyncio
import json
from array import array
from pathlib import Path
from typing import Any

import pytest
from cbor2 import CBORTag, dumps
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.protocol.test_occupancy_grid import PROFILE, grid
from urc.config.load import load_profile
from urc.protocol.forms.topics import packed_topics
from urc.runtime.registries import built_in_catalog
from urc.transports.ros.rosbridge_cells import packed_operation
from urc.transports.ros.rosbridge_operations import OperationReader

MAPS = frozenset(("/map",))


def frame(cells: list[Any], topic: str = "/map", **message: Any) -> bytes:
    said = {"op": "publish", "topic": topic, "msg": {**grid(1, 1, cells), **message}}
    return json.dumps(said).encode()


def packed(text: bytes) -> dict[str, Any] | None:
    return asyncio.run(packed_operation(text, MAPS))


@given(st.lists(st.integers(-128, 127)), st.booleans())
def test_cells_become_bytes_and_all_else_stays_as_it_is(cells: list[int], is_tight: bool) -> None:
    text = frame(cells)
    found = packed(text.replace(b" ", b"") if is_tight else text)
    assert found is not None
    assert array("b", found["msg"].pop("data")).tolist() == cells
    expected = json.loads(text)
    del expected["msg"]["data"]
    assert found == expected


def test_the_topic_may_come_last() -> None:
    said = {"msg": grid(1, 1, [1, -1]), "topic": "/map", "op": "publish"}
    found = packed(json.dumps(said).encode())
    assert found is not None
    assert found["msg"]["data"] == b"\1\xff"


@pytest.mark.parametrize(
    "text",
    [
        frame([0, 1], topic="/scan"),
        frame([0, 128]),
        frame([0, 1.5]),
        frame([0, None]),
        frame([0, [1], 2]),
        frame([0, True]),
        frame([]).replace(b"[]", b"[1,,2]"),
        frame([]).replace(b"[]", b"[1," + b" " * 100_000 + b"2]"),
        frame([0])[:-2],
        b'{"op":"publish","topic":"/map","msg":{"data":[1,2',
        b'{"op":"publish","topic":["/map"],"msg":{"data":[1]}}',
        b'{"op":"publish","topic":"/map","msg":{"info":{"data":[1]},"data":"x"}}',
        b'{"op":"publish","topic":"/map","msg":[{"data":[1]}]}',
        b'{"op":"publish","topic":"/map","msg":{"note":"\\"data\\":[1]","data":7}}',
        b'[{"data":[1]}]',
        b'{"op":"publish","topic":"/map"}',
    ],
    ids=lambda text: text[:70].decode(),
)
def test_other_frames_are_left_to_the_usual_reader(text: bytes) -> None:
    assert packed(text) is None


def test_other_tasks_run_between_the_pieces_of_a_large_map() -> None:
    """A guard must be able to write a stop while a map of three million cells arrives."""
    text = frame([0, 100, -1] * 1_000_000)

    async def decode() -> tuple[int, bytes]:
        turns = 0

        async def count() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        counting = asyncio.create_task(count())
        found = await packed_operation(text, MAPS)
        counting.cancel()
        assert found is not None
        return turns, found["msg"]["data"]

    turns, cells = asyncio.run(decode())
    assert cells == b"\x00\x64\xff" * 1_000_000
    assert turns > 500


@pytest.mark.parametrize("topic", ["/map", "/other"])
def test_typed_arrays_in_cbor_stay_bytes_for_maps_alone(topic: str) -> None:
    tagged = CBORTag(72, array("b", [0, 100, -1]).tobytes())
    text = dumps({"op": "publish", "topic": topic, "msg": {"data": tagged}})
    found = OperationReader(MAPS).read(text)
    assert found is not None
    assert found["msg"]["data"] == (b"\x00\x64\xff" if topic == "/map" else [0, 100, -1])


@pytest.mark.parametrize(
    ("path", "topics"),
    [
        ("", {"/map", "/map_updates"}),
        ("data[0]", {"/map_updates"}),
        ("length(data)", {"/map_updates"}),
    ],
)
def test_cells_that_a_document_reads_as_numbers_stay_numbers(
    tmp_path: Path, path: str, topics: set[str]
) -> None:
    read = f'  more: {{ subscribe: {{ topic: /map, type: a/B }}, json: {{ one: "{path}" }} }}\n'
    text = PROFILE.replace("signals:\n", "signals:\n  one: { type: integer }\n")
    file = tmp_path / "mapper.yaml"
    file.write_text(text.replace("messages:\n", f"messages:\n{read if path else ''}"))
    driver = load_profile(file, built_in_catalog()).driver
    assert packed_topics(driver, "ros", {"host": "127.0.0.1"}) == topics
