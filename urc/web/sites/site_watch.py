"""The other sites, as known to this dashboard: their robots, states and documents.

Layer 5. A site's list is requested when the site appears, and again while a menu is open. The site
answers such a request as soon as its list changes. A document is requested when its page opens,
checked against its digest, and kept.
"""

import asyncio
import hmac
import logging
import time
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final
from urllib.parse import quote

import msgspec

from urc.fleet.assertion import clock_refusal
from urc.fleet.versions import UNKNOWN, parse_version, version_refusal
from urc.model.profile import Profile
from urc.model.values import Value
from urc.private_files import make_private, put_private
from urc.problems import UrcError
from urc.runtime.open_profile import open_document
from urc.shipped import shipped
from urc.web.api.documents import document_of
from urc.web.api.wire import RobotSummary, SiteState
from urc.web.fleet.robots import Robot, SessionLike
from urc.web.serve.replies import ApiError
from urc.web.sites.robot_names import FarName
from urc.web.sites.site_client import SiteClient, SiteFailed
from urc.web.sites.site_routes import ROBOTS, SiteList, SiteRobot, digest_of_document

__all__ = ["KnownSite", "SiteWatch"]

PAUSE_S: Final = 0.2
"""Pause between two requests for the list of a site while a menu is open, in seconds."""
LOOK_S: Final = 2.0
"""Longest pause after failed requests, and for a site that does not wait for a change, in seconds.
Each of these pauses is twice as long as the one before."""
MOST_RETRY_S: Final = 60.0
"""The same while no menu is open, for a site that refuses its list."""
WATCHED_S: Final = 10.0
"""Time after a look at the menu during which lists are requested, in seconds."""
FOLDER: Final = "documents"
"""Folder of the received documents, in the folder of the membership."""
MAX_ROBOTS: Final = 2000
"""Maximum number of robots of a site; further robots are ignored."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class KnownSite:
    """The newest list of a site."""

    name: str
    robots: dict[str, SiteRobot]
    """Robots by their names at the site."""
    heard_s: float
    """Time of the list, on the clock of `SiteWatch`."""
    version: str = ""
    """Version of URC at the site."""
    fault: str = ""
    """Why the site's list cannot be read now; "" if it can."""
    ahead_s: float = 0.0
    """Time by which the site's clock was ahead of this site's clock, in seconds."""


class SiteWatch:
    """The other sites."""

    def __init__(
        self,
        client: SiteClient,
        folder: Path,
        clock: Callable[[], float] = time.monotonic,
        *,
        own: tuple[str, str] = ("", UNKNOWN),
        utc: Callable[[], float] = time.time,
    ) -> None:
        """Know no site yet.

        Args:
            client: requests to other sites.
            folder: folder of the membership.
            clock: time in seconds.
            own: name of this site, and its version of URC.
            utc: UTC time in seconds since 1970.
        """
        self._utc = utc
        self._client = client
        self._folder = folder / FOLDER
        self._clock = clock
        self._own = own
        self._known: dict[str, KnownSite] = {}
        self._looked_s = -WATCHED_S
        self._news = asyncio.Event()
        self._looks = asyncio.Event()
        self._robots: dict[FarName, tuple[str, Robot]] = {}
        """The newest opened document of each robot: its digest, and the robot made from it."""

    @property
    def sites(self) -> dict[str, KnownSite]:
        """All sites that were present since the start, by name."""
        return self._known

    def is_present(self, site: str) -> bool:
        """Return whether a site can be reached now."""
        return site in self._client.sites

    def refusal(self, site: str) -> str:
        """Return why the versions of a site and this site do not fit; "" if they do."""
        known = self._known.get(site)
        return version_refusal(site, known.version, *self._own) if known is not None else ""

    def trouble(self, site: str) -> str:
        """Return why the robots of a present site cannot be used; "" if they can.

        Unlike `refusal`, the reason may be over before the next list arrives, so it stops nothing.
        """
        known = self._known.get(site)
        if known is None:
            return ""
        return self.refusal(site) or known.fault or clock_refusal(site, self._own[0], known.ahead_s)

    def states(self) -> list[SiteState]:
        """Return all known sites, for the menu and for `urc fleet status`."""
        found = []
        for name, one in sorted(self._known.items()):
            is_here = self.is_present(name)
            trouble = self.trouble(name) if is_here else self.refusal(name)
            found.append(SiteState(name, _shown(one.version), is_here, trouble))
        return found

    def presence(self) -> dict[str, bool]:
        """Return whether each known site can be reached now."""
        return {name: self.is_present(name) for name in self._known}

    def changed(self) -> None:
        """Request the lists of sites that have appeared; called when the present sites change."""
        self._news.set()

    def summaries(self) -> list[RobotSummary]:
        """Return all robots of other sites, with their names on this server, and note the look.

        Robots of a site that is absent or in trouble are lost, with the reason.
        """
        self._looked_s = self._clock()
        self._looks.set()
        found = []
        for site, known in sorted(self._known.items()):
            reason = self.trouble(site)
            if not self.is_present(site):
                reason = f"the site {site} cannot be reached"
            for robot, one in known.robots.items():
                name = str(FarName(robot, site))
                summary = msgspec.structs.replace(
                    one.summary, name=name, tags=(site, *one.summary.tags)
                )
                if reason:
                    summary = msgspec.structs.replace(
                        summary, state="lost", detail=reason, battery=None, holder=""
                    )
                found.append(summary)
        return found

    async def run(self) -> None:
        """Request lists until cancelled; a site that hangs delays the lists of no other."""
        following: dict[str, asyncio.Task[None]] = {}
        async with asyncio.TaskGroup() as group:
            while True:
                here = self._client.sites
                for site in following.keys() - here:
                    following.pop(site).cancel()
                for site in here - following.keys():
                    following[site] = group.create_task(self._follow(site))
                self._news.clear()
                await self._news.wait()

    async def _follow(self, site: str) -> None:
        """Request the list of a site now, and again while a menu is open, until cancelled.

        A site that refuses its list is asked less and less while no menu is open.
        """
        mark, pause_s = "", PAUSE_S
        while True:
            mark = await self._ask(site, mark)
            pause_s = PAUSE_S if mark else min(2 * pause_s, MOST_RETRY_S)
            watched_s = min(pause_s, LOOK_S)
            await asyncio.sleep(watched_s)
            if self._clock() - self._looked_s >= WATCHED_S:
                has_failed = bool(self._known[site].fault)
                mark = ""
                self._looks.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(pause_s - watched_s if has_failed else None):
                        await self._looks.wait()

    async def robot(self, far: FarName) -> Robot:
        """Return a robot of another site for its page, made from the site's document.

        Raises:
            UrcError: the robot is unknown, its site cannot be reached, or its document is invalid.
        """
        if far.site not in self._known or far.robot not in self._known[far.site].robots:
            await self._ask(far.site)
        if refused := self.refusal(far.site):
            raise UrcError(refused)
        known = self._known.get(far.site)
        one = known.robots.get(far.robot) if known is not None else None
        if one is None:
            raise UrcError(
                (known.fault if known is not None else "")
                or f"the site {far.site} has no robot called {far.robot}"
            )
        kept = self._robots.get(far)
        if kept is None or kept[0] != one.digest:
            profile = await self._profile(far, one.digest)
            robot = Robot(profile, _defaults(profile), _no_session)
            kept = self._robots[far] = (one.digest, robot)
        return replace(kept[1], is_emulated=one.summary.emulated)

    async def _ask(self, site: str, after: str = "") -> str:
        """Request the list of a site; return its mark, or "" after a failure.

        Args:
            site: the site's name.
            after: mark of the newest list; the site waits for another one.
        """
        before = self._known.get(site)
        target = f"{ROBOTS}?after={after}" if after else ROBOTS
        try:
            async with self._client.request(site, "GET", target) as response:
                body = await response.whole()
            if response.status != 200:
                raise SiteFailed(f"the site {site} refuses its list (status {response.status})")
            found = msgspec.json.decode(body, type=SiteList)
        except (SiteFailed, msgspec.MsgspecError) as error:
            log.info("%s", error)
            robots = before.robots if before is not None else {}
            version = before.version if before is not None else ""
            self._known[site] = KnownSite(site, robots, self._clock(), version, str(error))
            return ""
        robots = {one.summary.name: one for one in found.robots[:MAX_ROBOTS]}
        ahead_s = found.time - self._utc()
        self._known[site] = KnownSite(site, robots, self._clock(), found.version, ahead_s=ahead_s)
        return found.mark

    async def _profile(self, far: FarName, digest: str) -> Profile:
        if shipped_profile := await asyncio.to_thread(_shipped, far.robot, digest):
            return shipped_profile
        file = self._folder / far.site / f"{digest}.yaml"
        if not await asyncio.to_thread(_is_kept, file, digest):
            target = f"/fleet/documents/{quote(far.robot, safe='')}"
            async with self._client.request(far.site, "GET", target) as response:
                data = await response.whole()
            if response.status != 200:
                raise SiteFailed(f"the site {far.site} refuses the document of {far.robot}")
            if not hmac.compare_digest(digest_of_document(data), digest):
                raise SiteFailed(f"the document of {far} does not match its digest; try again")
            await asyncio.to_thread(_keep, file, data)
        return await asyncio.to_thread(open_document, file)


def _defaults(profile: Profile) -> dict[str, Value]:
    return {name: one.default for name, one in profile.settings.items()}


def _shipped(name: str, digest: str) -> Profile | None:
    """Return the shipped robot with this document, which brings its models and picture."""
    file = shipped("robots") / f"{name}.yaml"
    if not file.is_file():
        return None
    try:
        profile = open_document(file)
        data = document_of(profile)
    except (UrcError, ApiError):
        return None
    return profile if digest_of_document(data) == digest else None


def _is_kept(file: Path, digest: str) -> bool:
    try:
        return digest_of_document(file.read_bytes()) == digest
    except OSError:
        return False


def _keep(file: Path, data: bytes) -> None:
    make_private(file.parent)
    put_private(file, data)


def _no_session() -> AbstractAsyncContextManager[SessionLike]:
    """Refuse a session: the robot is connected to its own site."""
    raise UrcError("this robot belongs to another site")


def _shown(version: str) -> str:
    """Return a version as other programs may show it; "" for an invalid one."""
    return version if parse_version(version) else ""
