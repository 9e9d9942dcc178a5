"""The OpenAPI document says what the routes do: each path, each shape, and nothing else."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from starlette.applications import Starlette
from starlette.routing import Route
from starlette.testclient import TestClient

from tests.unit.web.test_manage_routes import ADDRESS, robot_options, stock
from urc.testing.entry import ACCESS, HERE
from urc.web.api_document import DOCUMENT, api_document
from urc.web.app import build_app

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@pytest.fixture
def app(tmp_path: Path) -> Starlette:
    stock(tmp_path)
    return build_app(
        {}, access=ACCESS, data=tmp_path, robot_options=robot_options(tmp_path), remake={}
    )


@pytest.fixture
def document() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(api_document())
    return found


def routes_of(app: Starlette) -> Iterator[tuple[str, str]]:
    """Yield method and path of everything under the API."""
    for route in app.routes:
        if isinstance(route, Route) and route.path.startswith(("/api/", "/healthz")):
            for method in (route.methods or set()) - {"HEAD"}:
                yield method.lower(), route.path


def test_every_route_is_told_and_nothing_else(app: Starlette, document: dict[str, Any]) -> None:
    told = {(verb, path) for path, verbs in document["paths"].items() for verb in verbs}
    assert told == {one for one in routes_of(app) if one[1] != DOCUMENT}


def test_every_shape_is_a_schema_that_is_there(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    for name, schema in schemas.items():
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["description"], name
    refs = [part.split('"')[0] for part in json.dumps(document).split('"$ref": "')[1:]]
    assert len(refs) > 20
    assert {ref.rpartition("/")[2] for ref in refs} <= set(schemas)


def test_answers_are_what_the_document_says(app: Starlette, document: dict[str, Any]) -> None:
    """As good ones, so failures."""

    def fits(name: str, answer: Any) -> None:
        schema = {"$schema": DIALECT, "$ref": f"#/components/schemas/{name}", **document}
        jsonschema.validate(answer, schema)

    with TestClient(app, base_url=ADDRESS, headers={"origin": ADDRESS}, cookies=HERE) as client:
        assert client.get(DOCUMENT).json() == document
        fits("PackageList", client.get("/api/v1/packages").json())
        fits("HealthStatus", client.get("/healthz").json())
        gone = client.post("/api/v1/packages/remove", json={"package": "drivers/rover"})
        fits("RemovedPackages", gone.json())
        fits("Failure", client.post("/api/v1/job/agree", json={"number": 7}).json())
        saved = client.post("/api/v1/robots/rover/settings", json={"test": False})
        fits("SettingsAnswer", saved.json())
        with pytest.raises(jsonschema.ValidationError):
            fits("RemovedPackages", {"gone": "all"})
