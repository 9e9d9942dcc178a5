"""What a manager's page is told while the answers of repositories come in, from another thread."""

from types import SimpleNamespace
from typing import Any

from urc.web.manage.manager import Manager
from urc.web.manage.wire import RepositoryInfo

LAB = RepositoryInfo("http://lab/", "Lab", 0, "", False, True)


class Catalogue:
    """Its answers come at the very moment in which somebody has read the places."""

    def __init__(self) -> None:
        self.is_asking = True
        self._places: tuple[RepositoryInfo, ...] = ()

    @property
    def places(self) -> tuple[RepositoryInfo, ...]:
        """Return them as they were; then they have come."""
        before, self._places, self.is_asking = self._places, (LAB,), False
        return before

    def hits(self, words: str, kinds: tuple[str, ...]) -> list[Any]:
        """Find nothing."""
        return []


def test_a_page_that_was_told_too_little_is_told_to_ask_once_more() -> None:
    """Else it would say for good that no repository is known."""
    nothing = SimpleNamespace(installed=list)
    manager: Any = SimpleNamespace(
        catalogue=Catalogue(),
        factory=SimpleNamespace(store=nothing),
        jobs=SimpleNamespace(newest=None),
    )
    first = Manager.cache(manager, "", ("driver",), may_manage=True)
    assert (first.repositories, first.is_asking) == ((), True)
    second = Manager.cache(manager, "", ("driver",), may_manage=True)
    assert (second.repositories, second.is_asking) == ((LAB,), False)
