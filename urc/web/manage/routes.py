"""Routes for the manager pages and for the pages' requests under ``/api/v1``.

Layer 5. Changes are POST requests with a JSON body, sent by the server's own pages;
`urc.web.serve.policy` checks their origin. Each change requires the role `maintain` and a recent
sign-in, or the start key.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Final

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.packages.names import FOLDERS, PackageError, PackageRequirement, parse_requirement
from urc.problems import UrcError
from urc.runtime.server_recorder import ServerRecorder
from urc.web.manage.jobs import Busy, Wanted
from urc.web.manage.manager import Manager
from urc.web.manage.upload_source import given_source
from urc.web.manage.wire import (
    Add,
    InstallRequest,
    JobDecision,
    JobNews,
    RefreshRequest,
    RemovedPackages,
    ResultLine,
    Url,
)
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of, told
from urc.web.serve.rights import MAINTAIN_SERVER, SIGNED_IN, ProtectedRoute
from urc.web.serve.visitor import visitor_of
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["ManageRoutes"]


KINDS = {
    "drivers": ("driver", "robot"),
    "interfaces": ("interface",),
    "widgets": ("widget",),
}
"""Kinds of packages on each manager page, keyed by page name."""


@dataclass(frozen=True, slots=True)
class ManagePage:
    """Context for ``manage.html.j2``: repositories, installed packages and available packages."""

    head: PageHead
    nav: Nav
    title: str
    about: str
    """A short explanation of the kind of package that the page lists."""
    kinds: str
    """Kinds of packages, separated by commas."""
    may_manage: bool
    """Whether the visitor may change packages and settings."""
    may_name_paths: bool
    """Whether the visitor may enter paths on this machine, which requires the start key."""
    is_shown: bool
    """Whether the menu shows the installed robots."""


def manage_page(
    nonce: str,
    which: str,
    ways: NavigationLinks,
    *,
    may_manage: bool,
    may_name_paths: bool,
    is_shown: bool,
) -> str:
    """Return a manager page; `which` is a key in `KINDS`."""
    title, about = {
        "drivers": (
            t("Drivers"),
            t(
                "A driver connects URC to one kind of robot."
                " Its widgets and interfaces are installed with it."
            ),
        ),
        "interfaces": (
            t("Interfaces"),
            t("An interface arranges the widgets of a robot. Each compatible robot offers it."),
        ),
        "widgets": (
            t("Widgets"),
            t("A widget shows a value or sends a command."),
        ),
    }[which]
    page = ManagePage(
        PageHead(nonce, title),
        Nav(which, ways),
        title,
        about,
        ",".join(KINDS[which]),
        may_manage,
        may_name_paths,
        is_shown,
    )
    return render("manage.html.j2", page)


_NO_STORE: Final = {"cache-control": "no-store"}
_KINDS: Final = tuple(FOLDERS.values())
_Handler = Callable[["ManageRoutes", Request], Awaitable[Response]]


def _api(handler: _Handler) -> _Handler:
    """Convert a handler's `UrcError` to a response with one line of text."""

    @wraps(handler)
    async def handle(self: "ManageRoutes", request: Request) -> Response:
        try:
            return await handler(self, request)
        except ApiError as refusal:
            return told(refusal.status, refusal.line, refusal.code)
        except Busy as error:
            return told(409, str(error))
        except UrcError as error:
            return told(422, str(error).strip().partition("\n")[0])
        except OSError as error:
            return told(503, f"{error.filename or 'the disk'}: {error.strerror or error}")

    return handle


class ManageRoutes:
    """The manager routes of a dashboard."""

    def __init__(self, manager: Manager, ways: NavigationLinks, recorder: ServerRecorder) -> None:
        """Create the routes.

        Args:
            manager: the operations.
            ways: navigation links of this server.
            recorder: receives an entry for each change.
        """
        self._manager = manager
        self._ways = ways
        self._recorder = recorder

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes of the pages."""
        return [
            ProtectedRoute("/drivers", self.page, SIGNED_IN),
            ProtectedRoute("/interfaces", self.page, SIGNED_IN),
            ProtectedRoute("/widgets/installed", self.page, SIGNED_IN),
        ]

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the API endpoints, keyed by call name."""
        return {
            "packages": self.cache,
            "repositories_ask": self.refresh,
            "repositories_add": self.connect,
            "repositories_remove": self.disconnect,
            "packages_install": self.install,
            "packages_add": self.add,
            "packages_upload": self.upload,
            "packages_update": self.update,
            "packages_back": self.back,
            "packages_remove": self.remove,
            "job_agree": self.agree,
            "job_cancel": self.cancel,
        }

    async def page(self, request: Request) -> Response:
        """Show a manager page."""
        which = request.url.path.split("/")[1]
        html = manage_page(
            request.state.nonce,
            which,
            self._ways,
            may_manage=_may_manage(request),
            may_name_paths=visitor_of(request).is_local,
            is_shown=self._manager.factory.robot_options.shows_installed,
        )
        return HTMLResponse(html, headers=_NO_STORE)

    @_api
    async def cache(self, request: Request) -> Response:
        """Return the packages that match ``kinds`` and ``words`` from the lists in memory."""
        query = request.query_params
        kinds = tuple(one for one in query.get("kinds", "").split(",") if one in _KINDS) or _KINDS
        cache = await asyncio.to_thread(
            self._manager.cache,
            query.get("words", "")[:200],
            kinds,
            may_manage=_may_manage(request),
        )
        return answer(cache)

    @_api
    async def refresh(self, request: Request) -> Response:
        """Start a refresh from the repositories; ``force`` refreshes even recent lists.

        Any visitor may start a refresh, at most once per `FRESH_S` seconds.
        """
        said = await body_of(request, RefreshRequest)
        self._manager.catalogue.refresh(force=said.force and _may_manage(request))
        return answer(ResultLine(t("contacting the repositories")), 202)

    @_api
    async def connect(self, request: Request) -> Response:
        """Add a repository; the call fails if the repository does not respond."""
        said = await body_of(request, Url)
        text = said.url.strip()
        if "://" not in text:
            text = f"http://{text}"
        await self._manager.connect(text)
        self._record(request, "repository add", [text])
        return answer(ResultLine(t("connected")))

    @_api
    async def disconnect(self, request: Request) -> Response:
        """Remove a repository; packages installed from it remain installed."""
        said = await body_of(request, Url)
        await self._manager.disconnect(said.url)
        self._record(request, "repository remove", [said.url])
        return answer(ResultLine(t("removed; installed packages remain")))

    @_api
    async def install(self, request: Request) -> Response:
        """Start a job that downloads a named package and lists its permissions."""
        said = await body_of(request, InstallRequest)
        return self._begun(parse_requirement(said.package))

    @_api
    async def add(self, request: Request) -> Response:
        """Start a job that adds the package at a path in a repository or on the server."""
        said = await body_of(request, Add)
        return self._begun(self._meant(said.path.strip(), request))

    @_api
    async def upload(self, request: Request) -> Response:
        """Start a job that adds the package, bundle or interface in the request body."""
        if request.headers.get("content-type") != "application/octet-stream":
            raise ApiError(415, "expected a body of type application/octet-stream")
        name = request.query_params.get("name", "")[:200]
        data = await request.body()
        source = await asyncio.to_thread(
            given_source, name, data, self._manager.factory.store.installed()
        )
        return self._begun(source)

    @_api
    async def update(self, request: Request) -> Response:
        """Start a job that downloads the newest version of a package and lists the changes."""
        said = await body_of(request, InstallRequest)
        return self._begun(await asyncio.to_thread(self._manager.installed, said.package))

    @_api
    async def back(self, request: Request) -> Response:
        """Restore the version that a package had before its last update."""
        said = await body_of(request, InstallRequest)
        old = await self._manager.back(said.package)
        self._record(request, "restore", [str(old)])
        return answer(RemovedPackages((), t("restored {name}", name=old)))

    @_api
    async def remove(self, request: Request) -> Response:
        """Remove a package if ``yes`` is true; otherwise, list the packages to be removed."""
        said = await body_of(request, InstallRequest)
        if not said.yes:
            required = parse_requirement(said.package)
            gone = await asyncio.to_thread(self._manager.gone, required)
            filled = await asyncio.to_thread(self._manager.forgettable, required)
            return answer(RemovedPackages(tuple(gone), "", has_settings=bool(filled)))
        gone = await self._manager.remove(said.package, forgets=said.forget)
        self._record(request, "remove", gone or [said.package])
        line = t("removed {names}", names=", ".join(gone))
        if not gone:
            line = t("removed; its files remain, because another package needs them")
        return answer(RemovedPackages(tuple(gone), line))

    @_api
    async def agree(self, request: Request) -> Response:
        """Install the planned package."""
        said = await body_of(request, JobDecision)
        job = await self._manager.agree(
            said.number, takes_risks=said.takes_risks, unsigned=said.unsigned
        )
        if job.planned is not None:
            command = "install" if job.planned.old is None else "update"
            self._record(request, command, job.planned.plan.told, job.state)
        return answer(job.news())

    @_api
    async def cancel(self, request: Request) -> Response:
        """Cancel the job, unless its installation has started."""
        said = await body_of(request, JobDecision)
        return answer(self._manager.jobs.cancel(said.number).news())

    def _record(
        self, request: Request, command: str, packages: Iterable[str], outcome: str = "done"
    ) -> None:
        """Record a change of packages or repositories in the audit log."""
        self._recorder.package_changed(actor_of(request), command, packages, outcome)

    def _begun(self, what: Wanted) -> Response:
        news: JobNews = self._manager.jobs.begin(what).news()
        return answer(news, 202)

    def _meant(self, path: str, request: Request) -> PackageRequirement | Path:
        """Resolve a path in a repository (``/interfaces/wide/``) or a path on this machine."""
        inside = path.strip("/")
        if inside.partition("/")[0] in FOLDERS:
            try:
                return parse_requirement(inside)
            except PackageError:
                pass  # a folder on this machine may have that name
        if not visitor_of(request).is_local:
            raise ApiError(
                403, "a path on this machine needs the start key: open the address that URC printed"
            )
        place = Path(path).expanduser()
        if not place.is_absolute():
            raise PackageError(
                f"{path!r} is neither a path in a repository, such as /interfaces/NAME/,"
                " nor a full path on this machine"
            )
        return place


def _may_manage(request: Request) -> bool:
    return visitor_of(request).may(MAINTAIN_SERVER)
