"""A recording that is shown in place of a robot. Floor 5."""

from typing import Protocol

__all__ = ["Tape"]


class Tape(Protocol):
    """A recording that is played."""

    @property
    def began_s(self) -> float:
        """When it was recorded, in seconds since 1970."""

    @property
    def length_s(self) -> float:
        """How long it lasts."""

    @property
    def position_s(self) -> float:
        """Where it stands."""

    @property
    def is_playing(self) -> bool:
        """Whether it runs."""

    @property
    def speed(self) -> float:
        """How many seconds of it pass in one."""

    def play(self) -> None:
        """Run; from the beginning, where it stands at its end."""

    def pause(self) -> None:
        """Stand where it is."""

    def seek(self, position_s: float) -> None:
        """Go on from somewhere else."""
