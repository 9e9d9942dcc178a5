"""The playback of a recording in place of a robot. Layer 5."""

from typing import Protocol

__all__ = ["Tape"]


class Tape(Protocol):
    """A recording with its playback position."""

    @property
    def began_s(self) -> float:
        """Start time of the recording, in seconds since 1970."""

    @property
    def length_s(self) -> float:
        """Length of the recording, in seconds."""

    @property
    def position_s(self) -> float:
        """Playback position, in seconds from the beginning."""

    @property
    def is_playing(self) -> bool:
        """Whether the playback is running."""

    @property
    def speed(self) -> float:
        """Playback speed; 1 is real time."""

    def play(self) -> None:
        """Play; start again at the beginning if the position is the end."""

    def pause(self) -> None:
        """Pause at the current position."""

    def seek(self, position_s: float) -> None:
        """Move to a position."""
