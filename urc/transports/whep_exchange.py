"""The HTTP requests of WHEP (draft-ietf-wish-whep): the offer, the answer and the session's end.

The requests leave from the server's process, like those of all transports, and go only to the host
in the document.
"""

import asyncio
import ipaddress
from collections.abc import Sequence
from contextlib import suppress
from typing import Final, NamedTuple
from urllib.parse import urljoin

import httpx2

from urc._addresses import Address, is_of_this_machine, local_addresses, unmapped
from urc.transports._faults import late, one_line
from urc.transports.base import ConnectFailed, PeerClosed, TransportError
from urc.transports.camera_options import CameraOptions
from urc.transports.http_body import body_of, complaint, read_body
from urc.transports.http_client import HttpClient
from urc.transports.web_dial import Dialer
from urc.transports.whep_sdp import MAX_ANSWER_BYTES, WhepAnswer, read_answer

__all__ = ["WhepEnds", "WhepExchange", "ends_at"]

ANSWER_S: Final = 10.0
"""Maximum time from the offer to the complete answer, in seconds. Some servers connect to the
camera first."""
DELETE_S: Final = 1.0
"""Maximum time to end the session, in seconds."""
MAX_REDIRECTS: Final = 3
_SDP: Final = "application/sdp"
_REDIRECTS: Final = (301, 302, 307, 308)
_MOST_OWN: Final = 8
_WORDS: Final = {
    401: "the server refuses the user name, the password or the token",
    403: "the server refuses the user name, the password or the token",
    404: "the server has no stream at this path of the url, or no source for it now",
    405: "this path of the url accepts no offers, so it is not a WHEP address",
    406: "the server refuses the offer of H.264 and H.265",
    415: "this path of the url accepts no offers, so it is not a WHEP address",
}
"""Messages for statuses of the server."""


class WhepEnds(NamedTuple):
    """The IP addresses that may exchange datagrams."""

    hosts: tuple[str, ...]
    """Addresses of the camera; the first one is that of the HTTP connection."""
    own_hosts: tuple[str, ...]
    """Addresses of this computer from which they are reached."""


def ends_at(own: str, peer: str, near: Sequence[Address] | None = None) -> WhepEnds:
    """Return the permitted addresses for an HTTP connection.

    Only the address of the server counts. A server on this computer has all of this computer's
    addresses.

    Args:
        own: address of this computer's end of the connection.
        peer: address of the server's end.
        near: addresses of this computer, if the server is on it; None to find out.

    Raises:
        ConnectFailed: the server has a link-local IPv6 address, which a candidate cannot have.
    """
    server = ipaddress.ip_address(peer)
    if server.version == 6 and server.is_link_local:
        raise ConnectFailed(
            f"WHEP cannot use the link-local address {one_line(peer)}: write the server's IPv4"
            " address in the url"
        )
    if near is None:
        near = local_addresses() if is_of_this_machine(server) else ()
    others = tuple(str(one) for one in near if not (one.version == 6 and one.is_link_local))
    hosts, own_hosts = (str(unmapped(ipaddress.ip_address(one))) for one in (peer, own))
    return WhepEnds(
        tuple(dict.fromkeys((hosts, *others)))[:_MOST_OWN],
        tuple(dict.fromkeys((own_hosts, *others)))[:_MOST_OWN],
    )


class WhepExchange:
    """The requests of one session."""

    def __init__(self, options: CameraOptions) -> None:
        """Store the options, without connecting."""
        self._path = options.place.path
        place = options.place._replace(path="/")
        self._client = HttpClient(
            place,
            Dialer(place, tls=options.tls, tunnel=None),
            credentials=options.credentials,
            headers={},
            connections=2,
        )
        self._session = ""
        """URL of the session, which ends with a request to it; "" without a session."""

    async def reach(self, timeout_s: float) -> WhepEnds:
        """Connect within `timeout_s` seconds, and return the addresses of both ends.

        Raises:
            ConnectFailed: the server cannot be reached.
        """
        try:
            await self._client.reach(timeout_s)
            return ends_at(*self._client.ends())
        except BaseException:
            await self._client.close()
            raise

    async def answer(self, offer: bytes, hosts: Sequence[str]) -> WhepAnswer:
        """Send an offer and return the server's answer.

        Args:
            offer: the offer, as SDP.
            hosts: IP addresses of the camera.

        Raises:
            TransportError: the server sent no suitable answer.
        """
        try:
            async with asyncio.timeout(ANSWER_S):
                text = await self._post(offer)
        except TimeoutError as fault:
            raise PeerClosed(late(self._client.where, ANSWER_S)) from fault
        return read_answer(text, hosts)

    async def close(self) -> None:
        """End the session and close all connections. The method never raises."""
        try:
            if self._session:
                with suppress(TransportError, TimeoutError):
                    async with asyncio.timeout(DELETE_S):
                        request = self._client.follow("DELETE", self._session, {}, None)
                        async with self._client.answer(request, DELETE_S):
                            pass
        finally:
            await self._client.close()

    async def _post(self, offer: bytes) -> str:
        """Send the offer, also after redirects on the same server, and return the answer."""
        target, headers = self._path, {"Content-Type": _SDP, "Accept": _SDP}
        for _ in range(MAX_REDIRECTS + 1):
            request = self._client.follow("POST", target, headers, offer)
            async with self._client.answer(request, ANSWER_S) as response:
                place = response.headers.get("location", "")
                if response.status_code not in _REDIRECTS or not place:
                    return await self._answered(response, str(request.url), place)
                target = self._redirected(str(request.url), place)
        raise PeerClosed(f"the server redirects more than {MAX_REDIRECTS} times")

    def _redirected(self, asked: str, place: str) -> str:
        """Return the target of a redirect, which must be on the same server."""
        target = urljoin(asked, place)
        try:
            self._client.follow("GET", target, {}, None)
        except TransportError as fault:
            raise PeerClosed(
                f"the server redirects to {one_line(target)}; URC sends only to"
                f" {self._client.where}: write that address as url if it is yours"
            ) from fault
        return target

    async def _answered(self, response: httpx2.Response, asked: str, place: str) -> str:
        status = response.status_code
        if status in _WORDS:
            raise PeerClosed(f"{_WORDS[status]} (status {status})")
        if status >= 300:
            said = complaint(response, await body_of(response, MAX_ANSWER_BYTES))
            raise PeerClosed(f"the server refuses the offer: {said or status}")
        if place:
            self._session = urljoin(asked, place)
        kind = response.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != _SDP:
            raise PeerClosed(
                f"the server answers with {one_line(kind, 60) or 'no content type'} instead of"
                f" {_SDP}: this path of the url is not a WHEP address"
            )
        return (await read_body(response, MAX_ANSWER_BYTES)).decode("utf-8", "replace")
