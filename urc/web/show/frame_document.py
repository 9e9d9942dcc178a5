"""The document in the frame of a third-party widget: an empty cell and an import map.

Layer 5. The document contains no robot data; the page passes in the markup and values
(``frame_host.js``). The document's policy permits code from a few paths and blocks all other
network access.
"""

import base64
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.web.serve.policy import frame_policy
from urc.web.show.pages import render, with_words

__all__ = ["FramePage", "FrameDocuments"]


@dataclass(frozen=True, slots=True)
class FramePage:
    """Context for ``frame.html.j2``: the document around one third-party widget."""

    title: str
    import_map: Markup
    """Exact JSON text of the import map; the policy contains the text's digest."""
    style: str
    """URL of the widget's style sheet."""
    place: str
    """Path prefix of the frame's files."""


class FrameDocuments:
    """Creates frame documents.

    Args:
        modules: the pages' import map.
        has: function that returns whether a named widget exists.
        place: path prefix of code for frames.
    """

    def __init__(
        self, modules: Mapping[str, object], has: Callable[[str], bool], place: str
    ) -> None:
        self._modules = modules
        self._has = has
        self._place = place

    async def frame(self, request: Request) -> Response:
        """Return the frame document of a widget; raise status 404 for an unknown widget."""
        name, place = request.path_params["widget"], self._place
        if not self._has(name):
            raise HTTPException(404)
        text = htmlsafe_json_dumps(self._below(with_words(self._modules)))
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        request.state.frame_policy = frame_policy(request.scope, name, f"sha256-{digest}", place)
        page = FramePage(name, text, f"{place}/widgets/{name}/widget.css", place)
        return HTMLResponse(render("frame.html.j2", page), headers={"cache-control": "no-store"})

    def _below(self, modules: Mapping[str, object]) -> Mapping[str, object]:
        """Return the import map with the frames' path prefix before each URL."""
        imports = cast("Mapping[str, str]", modules["imports"])
        return {"imports": {name: f"{self._place}{url}" for name, url in imports.items()}}
