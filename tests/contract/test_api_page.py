"""What docs/api.md says about calls and rights is what the table of calls says."""

import re
from pathlib import Path

from urc.web.api.calls import CALLS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "api.md").read_text("utf-8")
ROWS = re.findall(r"^\| `(GET|POST) (/[^`]+)` \| ([^|]+?) \|$", PAGE, re.MULTILINE)
ABOUT_ROBOTS = (
    "/api/v1/robots",
    "/api/v1/recordings",
    "/api/v1/audit",
    "/api/v1/stop",
    "/api/v1/commands",
)


def test_the_rights_on_the_page_are_those_of_the_calls() -> None:
    told = {(method, f"/api/v1{path}"): right for method, path, right in ROWS}
    assert len(told) > 15
    calls = {(call.method, call.path): call for call in CALLS}
    for key, text in told.items():
        role = calls[key].right.role
        wanted = {None: "none", "watch": "watch"}.get(role, role) or ""
        if calls[key].right.scope == "anywhere" and role == "watch":
            wanted = "a sign-in"
        assert text.startswith(wanted), key


def test_every_call_about_robots_is_on_the_page() -> None:
    told = {f"/api/v1{path}" for _, path, _ in ROWS}
    robots = {
        call.path
        for call in CALLS
        if call.path.startswith(ABOUT_ROBOTS)
        and not call.path.endswith(("/recording", "/recording/move", "/settings", "/dev/start"))
    }
    assert robots == told
