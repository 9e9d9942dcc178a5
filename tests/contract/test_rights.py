"""Each route and each message of a socket names the right that it needs."""

from pathlib import Path
from typing import get_args

import pytest
from starlette.routing import BaseRoute

from tests.unit.web.test_manage_routes import robot_options
from urc.model.role import ROLES
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot
from urc.web.serve.rights import ANYONE, ProtectedRoute, ProtectedSocket
from urc.wire.client_messages import RIGHTS, ClientMessage

OPEN_TO_ALL = {
    "/api/v1/robots/{name}/stop",
    "/api/v1/stop",
    "/app.webmanifest",
    "/favicon.ico",
    "/api/v1/codes",
    "/api/v1/guest",
    "/api/v1/join",
    "/api/v1/pair",
    "/api/v1/sign-in",
    "/api/v1/sign-out",
    "/guest",
    "/healthz",
    "/sign-in/oidc",
    "/sign-in/oidc/callback",
    "/sign-in/passkey",
    "/sign-in/passkey/options",
    "/join",
    "/pair",
    "/sign-in",
    "/static/{file:path}",
    "/sw.js",
    "/trust",
    "/trust/authority.crt",
    "/vendor/{file:path}",
    "/words/{tag}.js",
}
"""Paths without a sign-in: STOP, the ways to sign in, and the pages of sign-in and certificate."""


@pytest.fixture
def routes(tmp_path: Path) -> list[BaseRoute]:
    """Return the routes of a dashboard with all managers and developer pages."""
    robot = FakeRobot(dashboard_profile())
    served = Robot(robot.profile, {}, robot.open)
    app = build_app(
        {"puppet": served},
        DashboardOptions(
            access=ACCESS,
            data=tmp_path,
            remake={"puppet": lambda _: served},
            robot_options=robot_options(tmp_path),
        ),
    )
    return list(app.routes)


def test_every_route_names_its_right(routes: list[BaseRoute]) -> None:
    for route in routes:
        assert isinstance(route, ProtectedRoute | ProtectedSocket), route


def test_only_named_routes_are_open_to_all(routes: list[BaseRoute]) -> None:
    """A new open route needs a line here."""
    open_ones = {
        route.path
        for route in routes
        if isinstance(route, ProtectedRoute | ProtectedSocket) and route.right == ANYONE
    }
    assert open_ones == OPEN_TO_ALL


def test_the_right_at_a_robot_has_a_robot_in_its_path(routes: list[BaseRoute]) -> None:
    for route in routes:
        assert isinstance(route, ProtectedRoute | ProtectedSocket)
        if route.right != ANYONE and route.right.scope == "robot":
            assert "{name}" in route.path, route


def test_every_message_of_a_socket_names_its_right() -> None:
    assert set(RIGHTS) == set(get_args(ClientMessage))
    assert all(role is None or role in ROLES for role in RIGHTS.values())
