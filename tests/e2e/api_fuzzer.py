"""A fuzzer of the HTTP API, generated from its OpenAPI document by Schemathesis.

Each call is tried with bodies and parameters that fit the document, and with others that don't.
Half of the paths name real robots, signals and commands, because random names reach only one line.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Final

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

from urc.web.api_document import api_document

__all__ = ["ENDLESS", "fuzzed", "operations"]

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
_CHECKS: Final = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
_TIMEOUT_S: Final = 15.0
_INSIDE: Final = "http://127.0.0.1:9/"


def operations() -> Iterator[tuple[str, Any]]:
    """Yield the name and the Schemathesis operation of each call that the fuzzer tries."""
    schema = schemathesis.openapi.from_dict(json.loads(api_document()))
    for found in schema.get_all_operations():
        operation = found.ok()
        name = operation.definition.raw["operationId"]
        if name not in ENDLESS:
            yield name, operation


def fuzzed(
    name: str, operation: Any, address: str, headers: Mapping[str, str], examples: int
) -> Counter[int]:
    """Try one call with many requests; return the number of answers by status.

    A server error, or an answer that the document does not describe, raises the check's error.

    Args:
        name: name of the call.
        operation: its Schemathesis operation.
        address: address of the server.
        headers: headers of the visitor.
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
            answer = case.call(base_url=address, headers=dict(headers), timeout=_TIMEOUT_S)
            statuses[answer.status_code] += 1
            case.validate_response(answer, checks=_CHECKS)

        with suppress(Unsatisfiable):  # no request of this kind is possible
            attempt()
    return statuses
