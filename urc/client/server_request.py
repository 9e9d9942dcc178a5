"""Requests to a server over HTTP.

Layer 5.
"""

from collections.abc import Mapping
from ssl import SSLContext
from typing import Any, Final

from urc.client.address import ServerAddress
from urc.client.robot import ConnectionLost
from urc.problems import UrcError

__all__ = ["post"]

_POST_S: Final = 3.0


async def post(
    server: ServerAddress,
    address: str,
    body: Mapping[str, Any] | None,
    what: str,
    *,
    token: str,
    context: SSLContext | None,
) -> Mapping[str, Any]:
    """Send a request over HTTP, and return the server's answer.

    Args:
        server: the server.
        address: address of the call.
        body: JSON body; None for a request without a body.
        what: the request in an error message, such as ``STOP``.
        token: the program's token; "" for a visitor without a sign-in, who may only press STOP.
        context: TLS context; None for plain HTTP.

    Raises:
        ConnectionLost: the server could not be reached.
        UrcError: the server refused the request.
    """
    import httpx2  # takes time to import, and few programs need it

    headers = {"Authorization": f"Bearer {token}"} if token else {"Origin": server.origin}
    try:
        async with httpx2.AsyncClient(
            verify=context if context is not None else True,
            # A proxy set in the environment cannot reach this computer, and would read the token.
            trust_env=not server.is_loopback,
            timeout=_POST_S,
        ) as client:
            answer = await client.post(address, headers=headers, json=body)
            said = answer.json()
    except (httpx2.HTTPError, OSError, ValueError) as error:
        raise ConnectionLost(f"{what} could not be delivered: {error}") from error
    if not isinstance(said, dict):
        raise UrcError(f"the server answered {answer.status_code}")
    if not answer.is_success:
        raise UrcError(str(said.get("error", f"the server answered {answer.status_code}")))
    return said
