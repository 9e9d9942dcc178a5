"""A fuzzer of the HTTP API, generated from its OpenAPI document by Schemathesis.

Each call is tried with bodies and parameters that fit the document, and with others that don't.
Half of the paths name real robots, signals and commands, because random names reach only one line.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple

import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from urc.access.grants import parse_grant, role_at
from urc.model.role import includes
from urc.web.api.calls import CALLS
from urc.web.api_document import api_document

__all__ = ["ENDLESS", "FuzzVisitor", "fuzzed", "operations"]

ENDLESS: Final = ("stream",)
"""Calls whose answer has no end; they have their own tests."""
_ELSEWHERE: Final = ("repositories_add", "packages_add")
"""Calls that would contact the address, or read the path, that they are given."""
_REAL: Final[Mapping[str, tuple[str, ...]]] = {
    "name": ("cart", "other"),
    "signal": ("battery", "speed", "never"),
    "command": ("echo", "mute", "tune", "launch", "erase", "arm", "halt", "drive", "twice"),
    "file": ("cart-20260101T000000Z.mcap",),
}
_TAGS: Final[Mapping[str, tuple[str, ...]]] = {"cart": ("lab",)}
_ABOVE_DRIVE: Final = {"tune": "maintain"}
"""Commands of the robots that need a higher role than their call."""
_CHECKS: Final = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
_NOTHING_SAID: Final = ("unauthorized", "forbidden", "not-found", "method-not-allowed")
"""Codes of answers that no endpoint gave."""
_TIMEOUT_S: Final = 15.0
_INSIDE: Final = "http://127.0.0.1:9/"
_CALLS: Final = {call.name: call for call in CALLS}


class FuzzVisitor(NamedTuple):
    """A sender of requests, and its rights."""

    headers: Mapping[str, str]
    grants: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    """Commands of its token; (): all of its role."""

    def may_call(self, name: str, robot: str) -> bool:
        """Return whether the visitor has the right of a call at a robot."""
        right = _CALLS[name].right
        if right.role is None:
            return True
        if right.is_local:
            return False
        grants = [parse_grant(one) for one in self.grants]
        if right.scope == "anywhere":
            return any(includes(one.role, right.role) for one in grants)
        where = robot if right.scope == "robot" else ""
        return includes(role_at(grants, where, _TAGS.get(where, ())), right.role)

    def may_run(self, command: str, robot: str) -> bool:
        """Return whether role and token permit a command."""
        if self.commands and command not in self.commands:
            return False
        role = role_at([parse_grant(one) for one in self.grants], robot, _TAGS.get(robot, ()))
        return command not in _ABOVE_DRIVE or includes(role, "maintain")


def operations() -> Iterator[tuple[str, Any]]:
    """Yield the name and the Schemathesis operation of each call that the fuzzer tries."""
    schema = schemathesis.openapi.from_dict(json.loads(api_document()))
    for found in schema.get_all_operations():
        operation = found.ok()
        name = operation.definition.raw["operationId"]
        if name not in ENDLESS:
            yield name, operation


def fuzzed(
    name: str, operation: Any, address: str, visitor: FuzzVisitor, examples: int
) -> Counter[int]:
    """Try one call with many requests; return the number of answers by status.

    A server error, an undocumented answer, or an answer beyond the right raises an error.

    Args:
        name: name of the call.
        operation: its Schemathesis operation.
        address: address of the server.
        visitor: sender of the requests.
        examples: number of requests of each kind.
    """
    statuses: Counter[int] = Counter()
    real = st.fixed_dictionaries({key: st.sampled_from(names) for key, names in _REAL.items()})
    for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):

        @settings(
            max_examples=examples,
            deadline=None,
            database=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy(generation_mode=mode), real=real, is_real=st.booleans())
        def attempt(case: Any, real: Mapping[str, str], is_real: bool) -> None:
            if is_real:
                known = case.path_parameters or {}
                case.path_parameters = {key: real.get(key, known[key]) for key in known}
            if name in _ELSEWHERE and isinstance(case.body, dict):
                for key in ("url", "path"):
                    if isinstance(case.body.get(key), str):
                        case.body[key] = _INSIDE
            headers = dict(visitor.headers)
            answer = case.call(base_url=address, headers=headers, timeout=_TIMEOUT_S)
            statuses[answer.status_code] += 1
            case.validate_response(answer, checks=_CHECKS, headers=headers)
            _check_right(name, case.path_parameters or {}, visitor, answer)

        with suppress(Unsatisfiable):  # no request of this kind is possible
            attempt()
    return statuses


def _check_right(name: str, path: Mapping[str, Any], visitor: FuzzVisitor, answer: Any) -> None:
    """Fail if an endpoint answered without the right of its call or command."""
    robot, command = str(path.get("name", "")), str(path.get("command", ""))
    if not visitor.may_call(name, robot):
        assert answer.status_code in (401, 403, 404, 405), f"{name} answered {answer.status_code}"
        assert answer.json()["code"] in _NOTHING_SAID
    elif command and not visitor.may_run(command, robot):
        assert answer.status_code != 200, f"{command} ran beyond the right"
