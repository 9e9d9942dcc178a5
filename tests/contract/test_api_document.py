"""The table of calls is the API: each route, right, shape and status, and nothing else."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from starlette.applications import Starlette
from starlette.routing import BaseRoute, Route
from starlette.testclient import TestClient

from tests.unit.web.test_manage_routes import ADDRESS, robot_options, stock
from urc.testing.entry import ACCESS, HERE
from urc.web.api.calls import CALLS, api_routes
from urc.web.api_document import DOCUMENT, api_document
from urc.web.app import DashboardOptions, build_app
from urc.web.serve.rights import ANYONE, ProtectedRoute, ProtectedSocket

DIALECT = "https://json-schema.org/draft/2020-12/schema"
OPEN_PATHS = {
    "/healthz",
    "/api/v1/robots/{name}/stop",
    "/api/v1/stop",
    "/api/v1/codes",
    "/api/v1/guest",
    "/api/v1/join",
    "/api/v1/pair",
    "/api/v1/sign-in",
    "/api/v1/sign-out",
}
"""Calls that need no right; a further one is a decision."""


@pytest.fixture
def app(tmp_path: Path) -> Starlette:
    stock(tmp_path)
    return build_app(
        {},
        DashboardOptions(
            access=ACCESS, data=tmp_path, robot_options=robot_options(tmp_path), remake={}
        ),
    )


@pytest.fixture
def document() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(api_document())
    return found


def is_call(route: BaseRoute) -> bool:
    return isinstance(route, Route) and route.path.startswith(("/api/", "/healthz"))


def test_every_route_is_told_and_nothing_else(app: Starlette, document: dict[str, Any]) -> None:
    """Method and path of everything under the API."""
    told = {(verb, path) for path, verbs in document["paths"].items() for verb in verbs}
    routes = [one for one in app.routes if is_call(one) and isinstance(one, Route)]
    found = {
        (method.lower(), one.path) for one in routes for method in (one.methods or set()) - {"HEAD"}
    }
    assert told == {one for one in found if one[1] != DOCUMENT}
    assert len(routes) == len(found), "two routes have the same path"


def test_a_shape_has_the_docstrings_of_its_fields(document: dict[str, Any]) -> None:
    """Under the names of the message, also beside a reference to another shape."""
    shapes = document["components"]["schemas"]
    said = shapes["LeaseAsked"]["properties"]["for_s"]["description"]
    assert said.startswith("Time limit for the holder's answer to")
    described = [
        one for shape in shapes.values() for one in shape.get("properties", {}).values()
        if "description" in one
    ]  # fmt: skip
    assert len(described) > 150
    assert any("anyOf" in one or "$ref" in one for one in described)


def test_every_route_of_the_server_names_its_right(app: Starlette) -> None:
    """Pages, files, calls and sockets alike."""
    without = [one for one in app.routes if not isinstance(one, (ProtectedRoute, ProtectedSocket))]
    assert without == []


def test_every_call_has_the_right_of_the_table(app: Starlette) -> None:
    """Only the named calls need none, and each names at least one right in the document."""
    rights = {(one.path, one.right) for one in app.routes if isinstance(one, ProtectedRoute)}
    assert {(call.path, call.right) for call in CALLS} <= rights
    assert {call.path for call in CALLS if call.right == ANYONE} == OPEN_PATHS


def test_names_of_calls_are_unique() -> None:
    names = [call.name for call in CALLS]
    assert len(set(names)) == len(names)
    pairs = [(call.method, call.path) for call in CALLS]
    assert len(set(pairs)) == len(pairs)


def test_an_endpoint_without_a_call_is_a_mistake() -> None:
    """It would be a route that nothing documents."""
    with pytest.raises(ValueError, match="without a call: secret"):
        api_routes({"secret": print})


def test_every_shape_is_a_schema_that_is_there(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    for name, schema in schemas.items():
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["description"], name
    refs = [part.split('"')[0] for part in json.dumps(document).split('"$ref": "')[1:]]
    assert len(refs) > 20
    assert {ref.rpartition("/")[2] for ref in refs} <= set(schemas)


def test_every_operation_tells_right_and_security(document: dict[str, Any]) -> None:
    schemes = document["components"]["securitySchemes"]
    for verbs in document["paths"].values():
        for operation in verbs.values():
            assert operation["description"].startswith("Right: ")
            needs = {name for one in operation["security"] for name in one}
            assert needs <= set(schemes)
            is_open = operation["description"] == "Right: none; a sign-in is not required."
            assert is_open == (not needs)
            assert ("401" in operation["responses"]) == bool(needs)


def test_answers_are_what_the_document_says(app: Starlette, document: dict[str, Any]) -> None:
    """As good ones, so failures."""

    def fits(name: str, answer: Any) -> None:
        schema = {"$schema": DIALECT, "$ref": f"#/components/schemas/{name}", **document}
        jsonschema.validate(answer, schema)

    with TestClient(app, base_url=ADDRESS, headers={"origin": ADDRESS}, cookies=HERE) as client:
        assert client.get(DOCUMENT).json() == document
        fits("PackageList", client.get("/api/v1/packages").json())
        fits("HealthStatus", client.get("/healthz").json())
        fits("RobotList", client.get("/api/v1/robots").json())
        fits("RecordingList", client.get("/api/v1/recordings").json())
        gone = client.post("/api/v1/packages/remove", json={"package": "drivers/rover"})
        fits("RemovedPackages", gone.json())
        fits("Failure", client.post("/api/v1/job/agree", json={"number": 7}).json())
        saved = client.post("/api/v1/robots/rover/settings", json={"test": False})
        fits("SettingsAnswer", saved.json())
        with pytest.raises(jsonschema.ValidationError):
            fits("RemovedPackages", {"gone": "all"})


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/api/v1/nothing", {}, 404),
        ("PUT", "/api/v1/robots", {"origin": ADDRESS}, 405),
        ("POST", "/api/v1/robots/x/lease", {}, 403),
        ("GET", "/api/v1/robots", {"host": "evil.example"}, 421),
        ("GET", "/api/v1/robots", {"content-length": "9999999"}, 413),
    ],
)
def test_every_refusal_of_the_api_is_json(
    app: Starlette, method: str, path: str, headers: dict[str, str], status: int
) -> None:
    """Also where no route was reached."""
    with TestClient(app, base_url=ADDRESS, cookies=HERE) as client:
        answer = client.request(method, path, headers=headers)
    assert answer.status_code == status
    failure = answer.json()
    assert failure["message"] == failure["error"]
    assert failure["code"]


def test_nobody_is_asked_for_a_sign_in_as_json(app: Starlette) -> None:
    with TestClient(app, base_url=ADDRESS) as client:
        answer = client.get("/api/v1/robots")
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized")
        assert answer.headers["www-authenticate"].startswith("Bearer")
        wrong = client.post("/api/v1/robots/x/lease", headers={"authorization": "Bearer wrong"})
        assert wrong.status_code == 401
