"""The schemas are the written grammar: described, consistent, and exactly what the loader reads."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012

from tests.effort import examples
from urc.config.gather import gather
from urc.config.load import WidgetFolder, check
from urc.config.node import Node
from urc.config.schemas import KINDS, QuickCheck, read_schema
from urc.problems import ProblemsError, to_text
from urc.protocol.framing.table import FRAMINGS
from urc.registry import Registries, Table
from urc.source import read_document
from urc.transports.table import TRANSPORTS

ROOT = Path(__file__).resolve().parents[2]
EVERY_KEY = ROOT / "tests" / "contract" / "every_key"
FILES = [f"{kind}.schema.json" for kind in KINDS]
CATALOG = Registries(
    transports=Table("urc.transports", dict.fromkeys((*TRANSPORTS, "pigeon"), "x:x")),
    framings=Table("urc.framings", dict.fromkeys((*FRAMINGS, "knots"), "x:x")),
)
REGISTRY: Registry[Any] = Registry().with_resources(
    (name, Resource.from_contents(read_schema(name), DRAFT202012)) for name in FILES
)
YAML_1_1_BOOLEANS = {"on", "off", "yes", "no", "y", "n", "true", "false"}


def validator(name: str) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(read_schema(name), registry=REGISTRY)


def resolved(file: str, schema: Any) -> tuple[str, Any]:
    """Follow references; what stands beside a reference goes before what it refers to."""
    while isinstance(schema, Mapping) and "$ref" in schema:
        other, _, pointer = schema["$ref"].partition("#")
        file = other or file
        target: Any = read_schema(file)
        for part in filter(None, pointer.split("/")):
            target = target[part]
        beside = {key: value for key, value in schema.items() if key != "$ref"}
        schema = target | beside if beside else target
    return file, schema


def subschemas(file: str, schema: Any, place: str) -> Iterator[tuple[str, str, Any]]:
    """Yield every part of a schema file that is a schema itself, with its place."""
    if not isinstance(schema, Mapping):
        return
    yield file, place, schema
    for keyword in ("properties", "$defs"):
        for name, inner in schema.get(keyword, {}).items():
            yield from subschemas(file, inner, f"{place}/{keyword}/{name}")
    for keyword in ("additionalProperties", "propertyNames", "items", "if", "then", "else"):
        if keyword in schema:
            yield from subschemas(file, schema[keyword], f"{place}/{keyword}")


ALL = [part for name in FILES for part in subschemas(name, read_schema(name), name)]
PROPERTIES = [
    pytest.param(file, inner, id=f"{place}/{name}")
    for file, place, schema in ALL
    if not place.endswith("/if")
    for name, inner in schema.get("properties", {}).items()
]


@pytest.mark.parametrize("name", FILES)
def test_schema_is_a_schema(name: str) -> None:
    """Held against the dialect's own schema."""
    jsonschema.Draft202012Validator.check_schema(read_schema(name))


@pytest.mark.parametrize(("file", "schema"), PROPERTIES)
def test_every_property_has_a_description_and_good_examples(file: str, schema: Any) -> None:
    """The reference pages and an editor's hover come from them, so the examples must be right."""
    home, whole = resolved(file, schema)
    assert whole.get("description", "").strip()
    assert whole.get("examples")
    document = {"$ref": f"{file}#"} if schema is read_schema(file) else schema
    beside = {key: value for key, value in document.items() if key != "$ref"}
    rebased = {"$ref": absolute(file, schema["$ref"])} | beside if "$ref" in schema else beside
    for example in whole["examples"]:
        rooted = jsonschema.Draft202012Validator(
            with_absolute_references(file, rebased), registry=REGISTRY
        )
        assert list(rooted.iter_errors(example)) == [], home


def absolute(file: str, reference: str) -> str:
    return file + reference if reference.startswith("#") else reference


def with_absolute_references(file: str, schema: Any) -> Any:
    if isinstance(schema, Mapping):
        return {
            key: absolute(file, value) if key == "$ref" else with_absolute_references(file, value)
            for key, value in schema.items()
        }
    if isinstance(schema, list):
        return [with_absolute_references(file, item) for item in schema]
    return schema


def test_kinds_are_told_apart_by_if_and_then() -> None:
    """With `oneOf` a typing error ends in "not valid under any of the given schemas"."""
    words = {"oneOf", "anyOf", "allOf", "not"}
    assert [place for _, place, schema in ALL if words & schema.keys()] == []


def test_no_key_is_a_boolean_of_yaml_1_1() -> None:
    """A reader that knows only YAML 1.1 must see the same keys."""
    keys = [(place, key) for _, place, schema in ALL for key in schema.get("properties", {})]
    assert keys
    assert [(place, key) for place, key in keys if key in YAML_1_1_BOOLEANS] == []


# ---- the quick verdict and jsonschema


def documents() -> list[Path]:
    """Return the path of every document in the tree, broken ones included."""
    folders = ("docs", "robots", "schemas", "templates", "tests", "urc", "widgets")
    return sorted(path for folder in folders for path in (ROOT / folder).rglob("*.yaml"))


@pytest.mark.cases(100)
@pytest.mark.parametrize("path", documents(), ids=lambda path: path.name)
def test_quick_verdict_agrees_with_jsonschema(path: Path) -> None:
    """For every kind, so that documents of one kind are bad ones of the other three."""
    try:
        data = read_document(str(path)).data
    except ProblemsError:
        return  # YAML cannot read it, so no schema sees it
    for name in FILES:
        verdict = QuickCheck(read_schema).is_valid(name, data)
        assert verdict == validator(name).is_valid(data), name


PUPPET = read_document(str(ROOT / "robots" / "puppet.yaml")).data
scalars = st.none() | st.booleans() | st.integers(-2, 70000) | st.floats() | st.text(max_size=4)
anything = st.recursive(
    scalars | st.sampled_from(["1s", "tcp", "{{ x }}", "a/b.yaml", "battery", "LF", 1, 1.0, True]),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=4,
)


@given(st.data())
@settings(max_examples=examples(200), deadline=None)
def test_quick_verdict_agrees_on_changed_documents(data: st.DataObject) -> None:
    """One change anywhere in a good document: both say the same of it."""
    changed = json.loads(json.dumps(PUPPET))
    place: Any = changed
    while True:
        key = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else [0]))
        inner = place[key]
        if not isinstance(inner, (dict, list)) or not inner or data.draw(st.booleans()):
            place[key] = data.draw(anything)
            break
        place = inner
    verdict = QuickCheck(read_schema).is_valid("robot.schema.json", changed)
    assert verdict == validator("robot.schema.json").is_valid(changed)


@pytest.mark.parametrize("schema", [{"oneOf": [True]}, {"properties": {"a": {"format": "uri"}}}])
def test_unknown_keyword_is_never_certain(schema: Any) -> None:
    """What the quick check does not know is left to jsonschema."""
    assert not QuickCheck(read_schema).is_valid_inline(schema, {"a": 1})


# ---- the schemas and the parsers


def places(
    file: str, schema: Any, data: Any, path: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], str, Mapping[str, Any]]]:
    """Yield each mapping of `data` that has declared keys: its path, its file, its properties."""
    file, schema = resolved(file, schema)
    if not isinstance(schema, Mapping):
        return
    if "if" in schema:
        fits = jsonschema.Draft202012Validator(schema["if"]).is_valid(data)
        yield from places(file, schema.get("then" if fits else "else", True), data, path)
        if branches_have_keys(schema):
            return  # the branch repeats the keys of its kind
    if isinstance(data, dict):
        properties = schema.get("properties", {})
        if properties:
            yield path, file, properties
        for key, item in data.items():
            inner = properties.get(key, schema.get("additionalProperties", True))
            yield from places(file, inner, item, (*path, key))
    elif isinstance(data, list):
        for number, item in enumerate(data):
            yield from places(file, schema.get("items", True), item, (*path, number))


def branches_have_keys(schema: Mapping[str, Any]) -> bool:
    """Return whether `then` and `else` tell kinds apart, or only ask for some of the keys."""
    branches = [schema[word] for word in ("then", "else") if word in schema]
    return bool(schema["if"].get("properties")) and any(
        branch.keys() != {"required"} for branch in branches
    )


class Reads:
    """Which keys the parsers asked for, and where."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: set[tuple[str, tuple[str | int, ...], str]] = set()
        for method in ("get", "must"):
            self._record(monkeypatch, method)

    def _record(self, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
        original = getattr(Node, method)

        def recording(part: Node, key: str) -> Any:
            self.asked.add((part.document.file, part.path, key))
            return original(part, key)

        monkeypatch.setattr(Node, method, recording)


DOCUMENTS = sorted(path.relative_to(EVERY_KEY).as_posix() for path in EVERY_KEY.rglob("*.yaml"))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_document_with_every_key_has_no_finding(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It shows that every key can be used as its description says."""
    monkeypatch.chdir(EVERY_KEY)
    checked = check(name, CATALOG, WidgetFolder(EVERY_KEY / "shelf"))
    told = [to_text(one) for one in checked.problems if one.code not in ("never-set",)]
    assert told == []


def test_loader_reads_every_key_of_the_schemas_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A key that the loader ignores, or one that the schema lacks, is found here."""
    monkeypatch.chdir(EVERY_KEY)
    reads = Reads(monkeypatch)
    covered: set[tuple[int, str]] = set()
    known: dict[tuple[str, tuple[str | int, ...]], set[str]] = {}
    present: set[tuple[str, tuple[str | int, ...], str]] = set()
    for name in DOCUMENTS:
        check(name, CATALOG, WidgetFolder(EVERY_KEY / "shelf"))
        data = read_document(name).data
        assert isinstance(data, dict)
        schema = f"{data['kind']}.schema.json"
        for path, _, properties in places(schema, read_schema(schema), data):
            covered |= {(id(properties), key) for key in value_at(data, path) if key in properties}
        # What the parsers see: put together from its parts, and every 'each' written out.
        sources = gather(name).sources
        data = sources.root.data if sources is not None else {}
        for path, file, properties in places(schema, read_schema(schema), data):
            at = value_at(data, path)
            known.setdefault((name, path), set()).update(properties)
            if file != "widget.schema.json" or path[:1] != ("options",):
                present |= {(name, path, key) for key in at if key in properties}
    never_used = [
        f"{place}: {key}"
        for _, place, schema in ALL
        if not place.endswith("/if") and not ("if" in schema and branches_have_keys(schema))
        for key in schema.get("properties", {})
        if (id(schema["properties"]), key) not in covered
    ]
    assert never_used == [], "these keys stand in no document of every_key"
    header = {(name, (), key) for name in DOCUMENTS for key in ("urc", "kind")}
    # Text for people who read the document; nothing shows it yet.
    header |= {one for one in present if one[1][:1] == ("params",) and one[2] == "description"}
    unread = present - reads.asked - header
    told = [
        (name, path, key) for name, path, key in unread if not is_option_of_transport(path, key)
    ]
    assert told == [], "the loader never reads these keys"
    undeclared = [
        (name, path, key)
        for name, path, key in reads.asked
        if (name, path) in known and key not in known[name, path]
    ]
    assert sorted(str(one) for one in undeclared if not is_shared_reader(one)) == []


def value_at(data: Any, path: tuple[str | int, ...]) -> Any:
    for part in path:
        data = data[part]
    return data


def is_option_of_transport(path: tuple[str | int, ...], key: str) -> bool:
    """A transport's own options are handed to it whole."""
    return len(path) >= 2 and path[-2] == "transports" and key in ("host", "port")


def common_keys() -> set[str]:
    """Return the keys of every kind of transport."""
    common = read_schema("driver.schema.json")["$defs"]["anyTransport"]["properties"]
    return set(common)


def is_shared_reader(asked: tuple[str, tuple[str | int, ...], str]) -> bool:
    """One parser serves places of which the schema allows some keys and not others.

    `parse_interface` reads the header of documents and the layouts inside a robot alike. Forms are
    read alike in replies and in steps, which may not `set` anything. Kinds of transport
    are read alike, though messages have no framing, not everything goes through something else, and
    a web server always answers, and brokers carry many at once; one of another package has options
    that no schema of ours knows.
    """
    name, path, key = asked
    if path[-2:-1] == ("transports",):
        kind = value_at(read_document(name).data, path)["type"]
        if kind == "camera" and key in common_keys():
            return True  # nothing is sent to a camera, so it has no queue and no steps
        return kind not in TRANSPORTS or key in (
            "replies",
            "connection",
            "duplex",
            "encoding",
            "framing",
            "send_framing",
            "tunnel",
        )
    if key == "subscribe" and "simulator" in path:
        return True
    if key == "set":
        return not {"on_connect", "on_close", "sequences", "simulator"}.isdisjoint(path)
    return path[:1] == ("interfaces",) and key in ("summary", "licence", "author")
