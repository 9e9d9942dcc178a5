"""`urc serve`: the dashboard on real robots."""

import argparse
import ipaddress

from urc.cli.arguments import add_host, add_port, add_settings, load
from urc.cli.output import complain

EXAMPLE = "urc serve robots/puppet.yaml --set host=192.168.1.20"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the profiles, their settings, and where to listen."""
    parser.add_argument("profiles", metavar="PROFILE", nargs="+", help="robot files or names")
    add_settings(parser)
    add_host(parser)
    add_port(parser)
    parser.add_argument(
        "--allow-host",
        dest="allowed_hosts",
        metavar="NAME",
        action="append",
        default=[],
        help="a name people reach this machine by, besides its addresses",
    )
    parser.add_argument(
        "--simulate", action="store_true", help="emulate the robots instead of connecting"
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C or SIGTERM."""
    from urc.cli.dashboard import Place, run_dashboard
    from urc.cli.settings import settings_given

    profiles = [load(word) for word in arguments.profiles]
    values = [values for values, _ in settings_given(profiles, arguments)]
    if not _is_loopback(arguments.host):
        complain(
            f"urc serve: {arguments.host} can be reached by others, and there is no sign-in yet:"
            " anyone on that network can drive these robots"
        )
    return run_dashboard(
        list(zip(profiles, values, strict=True)),
        Place(arguments.host, arguments.port, tuple(arguments.allowed_hosts)),
        is_simulated=arguments.simulate,
        on_ready=_print_address,
    )


def _print_address(url: str) -> None:
    print(f"dashboard {url}", flush=True)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
