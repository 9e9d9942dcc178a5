"""STOP of robots of other sites: one request for each site, repeated until the site answers it.

Layer 5. Requests to several sites run in parallel on the control lane, so an absent site delays
none of the others. A repetition has the same identifier, so the site ignores it after the first.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Final, NamedTuple

import msgspec

from urc.problems import UrcError
from urc.web.fleet.robots import STOP_DUE_S
from urc.web.sites.site_client import SiteClient, SiteFailed
from urc.web.sites.stop_routes import STOP, SiteStopAnswer, SiteStopAsked

__all__ = ["ANSWER_S", "SiteStops"]

ANSWER_S: Final = 0.75
"""Longest wait for the reply of a site, in seconds; the rest of a second is for a busy server."""
REPEAT_S: Final = 0.5
"""Pause before a repetition to a site that has not answered, in seconds."""
REPEAT_ANSWER_S: Final = 5.0
"""Longest wait for the reply to a repetition, in seconds."""
_JSON: Final = ((b"content-type", b"application/json"),)

log = logging.getLogger(__name__)

_Late = Callable[[str, SiteStopAsked, SiteStopAnswer], None]


class _Due(NamedTuple):
    """A STOP that a site has not answered, and the callback for the reply to its repetition."""

    asked: SiteStopAsked
    on_late: _Late


class SiteStops:
    """Sends STOP to other sites."""

    def __init__(
        self, client: SiteClient, *, answer_s: float = ANSWER_S, repeat_s: float = REPEAT_S
    ) -> None:
        """Create the object.

        Args:
            client: requests to other sites.
            answer_s: longest wait for the reply of a site, in seconds.
            repeat_s: pause before a repetition, in seconds.
        """
        self._client = client
        self._answer_s = answer_s
        self._repeat_s = repeat_s
        self._due: dict[str, dict[str, _Due]] = {}
        """The newest unanswered STOP of each robot, by site and by the robot's name there."""
        self._ends_s: dict[str, float] = {}
        """Time at which the repetitions to a site end, on the loop's clock."""
        self._tasks: dict[str, asyncio.Task[None]] = {}

    async def stop(self, site: str, asked: SiteStopAsked, on_late: _Late) -> SiteStopAnswer:
        """Stop robots of a site, and return the site's reply.

        Args:
            site: the site.
            asked: the robots, and who stops them.
            on_late: callback for the reply to a repetition, after this call has failed.

        Raises:
            SiteFailed: the site has not answered in time; STOP is repeated in the background.
        """
        try:
            answer = await self._ask(site, asked, self._answer_s)
        except SiteFailed:
            self._repeat(site, asked, on_late)
            raise
        due = self._due.get(site, {})
        for name in _keys(asked):
            due.pop(name, None)  # this STOP is newer than each earlier one
        return answer

    async def close(self) -> None:
        """End all repetitions."""
        tasks = tuple(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _ask(self, site: str, asked: SiteStopAsked, within_s: float) -> SiteStopAnswer:
        body = msgspec.json.encode(asked)
        try:
            async with (
                asyncio.timeout(within_s),
                self._client.request(site, "POST", STOP, _JSON, body, lane="control") as response,
            ):
                text = await response.whole()
            if response.status != 200:
                raise SiteFailed(f"the site {site} refuses STOP (status {response.status})")
            return msgspec.json.decode(text, type=SiteStopAnswer)
        except TimeoutError:
            raise SiteFailed(f"the site {site} has not answered within {within_s:g} s") from None
        except msgspec.MsgspecError as error:
            raise SiteFailed(f"the site {site} sent an invalid response ({error})") from error
        except (UrcError, OSError) as error:
            raise SiteFailed(str(error)) from error

    def _repeat(self, site: str, asked: SiteStopAsked, on_late: _Late) -> None:
        self._due.setdefault(site, {}).update(dict.fromkeys(_keys(asked), _Due(asked, on_late)))
        self._ends_s[site] = asyncio.get_running_loop().time() + STOP_DUE_S
        if site not in self._tasks:
            task = self._tasks[site] = asyncio.create_task(self._keep_asking(site))
            task.add_done_callback(lambda _: self._tasks.pop(site, None))

    async def _keep_asking(self, site: str) -> None:
        """Repeat unanswered STOPs until the site has answered, for at most `STOP_DUE_S` seconds."""
        loop = asyncio.get_running_loop()
        due = self._due[site]
        while due and loop.time() < self._ends_s[site]:
            await asyncio.sleep(self._repeat_s)
            for one in {one.asked.id: one for one in due.values()}.values():
                if not await self._again(site, one, due):
                    break
        self._due.pop(site, None)

    async def _again(self, site: str, one: _Due, due: dict[str, _Due]) -> bool:
        """Repeat a STOP for robots without a newer one; return whether the site has answered."""
        roles = one.asked.robots.items()
        robots = {name: role for name, role in roles if due.get(name) is one}
        again = msgspec.structs.replace(one.asked, robots=robots)
        try:
            answer = await self._ask(site, again, REPEAT_ANSWER_S)
        except SiteFailed as fault:
            log.info("STOP is repeated: %s", fault)
            return False
        for name in _keys(again):
            if due.get(name) is one:
                del due[name]
        one.on_late(site, again, answer)
        return True


def _keys(asked: SiteStopAsked) -> tuple[str, ...]:
    """Return the robots that a STOP names; ("",) if the site itself chooses the robots."""
    return tuple(asked.robots) or ("",)
