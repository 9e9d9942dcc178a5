"""The route ``/metrics``, which returns metrics in the format that the client accepts.

Layer 5. The package `prometheus-client` is imported at the first request.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from urc._extras import missing
from urc.model.role import includes
from urc.web.fleet.robots import RobotService
from urc.web.metrics.metric_names import ReadingChoice
from urc.web.serve.rights import SIGNED_IN, WATCH, ProtectedRoute
from urc.web.serve.visitor import visitor_of

if TYPE_CHECKING:
    from prometheus_client.metrics_core import Metric

    from urc.web.metrics.loop_delay import LoopDelay

__all__ = ["METRICS", "MetricRoutes", "missing_package"]

METRICS: Final = "/metrics"
_HEADERS: Final = {"cache-control": "no-store"}


def missing_package() -> str:
    """Return why there are no metrics, as one line; "" if the package is installed."""
    if find_spec("prometheus_client") is not None:
        return ""
    return missing("metrics need", "prometheus-client", "metrics")


class MetricRoutes:
    """The route for metrics."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        site: str,
        sites: Callable[[], Mapping[str, bool]],
        choices: Sequence[ReadingChoice],
        version: str,
    ) -> None:
        """Create the route.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            site: name of this site; "" outside a fleet.
            sites: function that returns the known other sites, and whether each is present.
            choices: the readings to publish.
            version: version of URC.
        """
        self._services = services
        self._site = site
        self._sites = sites
        self._choices = tuple(choices)
        self._version = version
        self._delay: LoopDelay | None = None

    def routes(self) -> list[ProtectedRoute]:
        """Return the route."""
        return [ProtectedRoute(METRICS, self.metrics, SIGNED_IN)]

    def close(self) -> None:
        """End the measurements."""
        if self._delay is not None:
            self._delay.close()

    async def metrics(self, request: Request) -> Response:
        """Return the metrics that the visitor may see."""
        if text := missing_package():
            return PlainTextResponse(f"{text}\n", 501, headers=_HEADERS)
        from prometheus_client.exposition import choose_encoder

        visitor = visitor_of(request)
        services = {name: one for name, one in self._services().items() if visitor.may(WATCH, name)}
        sees_server = includes(visitor.role(), "watch")
        families = self._collected(services, sees_server=sees_server)
        encode, media = choose_encoder(request.headers.get("accept", ""))
        data = await asyncio.to_thread(_encoded, encode, families, sees_server)
        return Response(data, headers={**_HEADERS, "content-type": media})

    def _collected(
        self, services: Mapping[str, RobotService], *, sees_server: bool
    ) -> "list[Metric]":
        from prometheus_client.core import GaugeMetricFamily, InfoMetricFamily

        from urc.web.metrics.loop_delay import LoopDelay
        from urc.web.metrics.robot_metrics import robot_metrics

        families: list[Metric] = [*robot_metrics(services, self._site, self._choices)]
        if not sees_server:
            return families
        families.append(InfoMetricFamily("urc", "The server.", {"version": self._version}))
        present = GaugeMetricFamily(
            "urc_site_present", "Whether another site can be reached.", labels=("site",)
        )
        for name, is_present in self._sites().items():
            present.add_metric((name,), is_present)
        self._delay = self._delay or LoopDelay()
        return [*families, present, *self._delay.asked()]


class _Snapshot:
    """Collected metrics, as the encoders of the library expect them."""

    def __init__(self, families: "Iterable[Metric]") -> None:
        self._families = families

    def collect(self) -> "Iterable[Metric]":
        return self._families


def _encoded(encode: Any, families: "list[Metric]", has_process: bool) -> bytes:
    """Return metrics as text, with the metrics of this process on Linux."""
    from prometheus_client import ProcessCollector

    process = ProcessCollector(registry=None).collect() if has_process else ()
    data: bytes = encode(_Snapshot([*families, *process]))
    return data
