"""Requests that read or change the playback of a recording.

Layer 5. A playback has the same pages as a robot, but without controls. Visitors with the role
``drive`` may control the playback without a lease, because no real robot is connected.
"""

import math

from starlette.requests import Request
from starlette.responses import Response

from urc.web.fleet.robots import Playback
from urc.web.manage.wire import PlaybackRequest, PlaybackState
from urc.web.serve.replies import ApiError, answer, body_of, told

__all__ = ["move_playback", "playback_state"]


def playback_state(playback: Playback | None) -> Response:
    """Return the playback's state as a response; status 404 if there is no playback."""
    if playback is None:
        return told(404, "this is not a playback")
    return answer(
        PlaybackState(
            began_s=playback.began_s,
            length_s=playback.length_s,
            position_s=playback.position_s,
            is_playing=playback.is_playing,
            speed=playback.speed,
        )
    )


async def move_playback(request: Request, playback: Playback | None) -> Response:
    """Play, pause or seek the playback; return its state as a response."""
    if playback is None:
        return told(404, "this is not a playback")
    try:
        asked = await body_of(request, PlaybackRequest)
    except ApiError as refusal:
        return told(refusal.status, refusal.line, refusal.code)
    if asked.position_s is not None and math.isfinite(asked.position_s):
        playback.seek(asked.position_s)
    if asked.is_playing is not None and asked.is_playing != playback.is_playing:
        (playback.play if asked.is_playing else playback.pause)()
    return playback_state(playback)
