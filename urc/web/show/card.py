"""The content of a robot's menu card: a camera image, a picture, a simulated world, or values.

Layer 5. A card never connects to a robot. The card of a robot with a picture shows the picture or,
while the robot is connected, its camera image. The card of an emulated robot without a picture
shows its simulated world. The card of a real robot without a picture shows data while the robot is
connected, and the last image afterwards.
"""

from collections.abc import Callable, Mapping

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from urc.images import media_type
from urc.model.driver import Driver
from urc.model.values import BINARY_TYPES, Reading, Signal
from urc.web.fleet.robots import RobotService
from urc.web.load.files import picture
from urc.web.serve.rights import WATCH, ProtectedRoute
from urc.web.show.cells import spoken
from urc.web.words import t

__all__ = ["VALUES", "Cards", "small_values"]

VALUES = 4
"""Maximum number of values displayed on a card without an image."""
_FRESH = {"cache-control": "no-store"}
_UNSHOWN = (*BINARY_TYPES, "array", "transform_tree")


class Cards:
    """The route for the current content of the menu's cards.

    Args:
        services: function that returns the robots' services, keyed by the robots' names in URLs.
    """

    def __init__(self, services: Callable[[], Mapping[str, RobotService]]) -> None:
        self._services = services

    def routes(self) -> list[ProtectedRoute]:
        """Return the route for card contents."""
        return [ProtectedRoute("/robots/{name}/card", self.card, WATCH)]

    async def card(self, request: Request) -> Response:
        """Return an image, values as JSON ``[[title, text], …]``, or status 204 without data.

        The header ``x-urc-old`` marks the last image of a session that has ended. The header
        ``x-urc-picture`` marks the robot's picture, which seldom changes.
        """
        name = request.path_params["name"]
        service = self._services().get(name)
        if service is None:
            raise HTTPException(404, t("This server has no robot called “{name}”.", name=name))
        seen = service.glimpse()
        is_open = service.open_session is not None
        if service.robot.profile.picture and not (is_open and isinstance(seen, bytes)):
            found = picture(service.robot.profile, request)
            found.headers["x-urc-picture"] = "1"
            return found
        if seen is None:
            return Response(status_code=204, headers=_FRESH)
        if isinstance(seen, bytes):
            is_old = service.robot.glimpse is None and not is_open
            headers = {**_FRESH, "x-urc-old": "1"} if is_old else _FRESH
            return Response(seen, media_type=media_type(seen), headers=headers)
        shown = small_values(service.robot.profile.driver, seen)
        return JSONResponse(shown, headers=_FRESH)


def small_values(driver: Driver, readings: Mapping[str, Reading]) -> list[tuple[str, str]]:
    """Return the titles and texts of the values shown on the robot's card."""
    found = [
        (one.title or spoken(name), _text(one, readings[name]))
        for name, one in driver.signals.items()
        if one.type not in _UNSHOWN and readings.get(name) is not None
    ]
    return found[:VALUES]


def _text(signal: Signal, value: Reading) -> str:
    if isinstance(value, bool):
        return t("yes") if value else t("no")
    if isinstance(value, bytes):
        return f"{len(value)} B"
    if isinstance(value, float):
        value = f"{value:.{1 if signal.precision is None else signal.precision}f}"
    return f"{value} {signal.unit}" if signal.unit else str(value)
