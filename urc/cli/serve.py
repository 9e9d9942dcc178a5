"""`urc serve`: serve the dashboard for real robots."""

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.arguments import (
    add_dev,
    add_foxglove,
    add_host,
    add_port,
    add_settings,
    is_loopback,
    load,
)
from urc.cli.error_report import Misuse
from urc.cli.fault_injection import add_faults
from urc.cli.output import complain
from urc.cli.tls_options import add_tls, tls_of
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value
    from urc.web.alarms.notify_options import NotifyOptions
    from urc.web.metrics.metric_names import ReadingChoice
    from urc.web.people.ways_in import SignInOptions

EXAMPLE = "urc serve puppet --set host=192.168.1.20"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: profiles, settings and address."""
    parser.add_argument(
        "profiles",
        metavar="PROFILE",
        nargs="*",
        help="robot files or robot names (default: all installed robots)",
    )
    add_settings(parser)
    add_host(parser)
    add_port(parser)
    add_foxglove(parser)
    _add_names(
        parser, "--allow-host", "additional host name under which clients reach this machine"
    )
    add_tls(parser)
    parser.add_argument(
        "--simulate", action="store_true", help="emulate the robots instead of connecting to them"
    )
    add_faults(parser, has_names=True)
    add_dev(parser)
    parser.add_argument(
        "--installed",
        action="store_true",
        help="also serve all installed robots and drivers",
    )
    _add_sign_in(parser)
    parser.add_argument(
        "--no-guard",
        dest="has_guard",
        action="store_false",
        help="for debugging: send motion commands without a guard process;"
        " if this process hangs, robots are not stopped",
    )
    _add_alarms(parser)
    _add_others(parser)
    for flag, text in (
        ("--data-dir", "data folder for latched stops, audit log and settings"),
        (
            "--tiles",
            "folder of map tiles, FOLDER/z/x/y.png, for the option `tiles` of the map widget",
        ),
        ("--record", "record each session to a file in this folder, for 'urc replay'"),
    ):
        parser.add_argument(flag, metavar="FOLDER", type=Path, help=text)
    _add_names(
        parser,
        "--trust-widget",
        "run a third-party widget in the page with all rights of the page, instead of in a"
        " sandboxed frame",
    )


def _add_names(parser: argparse.ArgumentParser, flag: str, text: str) -> None:
    parser.add_argument(flag, metavar="NAME", action="append", default=[], help=text)


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C or SIGTERM."""
    from urc.cli.dashboard import DashboardAddress, run_dashboard
    from urc.cli.settings import settings_given
    from urc.cli.start_addresses import print_entrance
    from urc.runtime.settings import resolve_settings
    from urc.runtime.widget_registry import hidden_beside

    _check(arguments)
    tls_of(arguments)
    profiles = [load(word) for word in arguments.profiles]
    if not profiles and (arguments.settings or arguments.settings_file):
        raise Misuse("--set and --settings require a profile on the command line")
    settings_given(profiles, arguments)  # report invalid settings before the server starts
    for folder in dict.fromkeys(each for one in profiles for each in hidden_beside(one.file)):
        complain(f"urc serve: {folder} is ignored: a widget with this name ships with URC")
    _warn(arguments)

    def given(profile: "Profile") -> Mapping[str, "Value"]:
        bare = profile._replace(
            settings={
                name: one._replace(default=None, is_required=True)
                for name, one in profile.settings.items()
            }
        )
        named = [one.name for one in profiles]
        if profile.name not in named:
            return resolve_settings(bare, {}, os.environ)[0]  # an installed profile
        others = [one for one in profiles if one.name != profile.name]
        return settings_given([bare, *others], arguments)[0][0]

    return run_dashboard(
        profiles,
        DashboardAddress(
            arguments.host,
            arguments.port,
            tuple(arguments.allow_host),
            arguments.data_dir,
            arguments.has_guard,
            arguments.tiles,
            arguments.is_open,
            arguments.installed or not profiles,
            tuple(arguments.trust_widget),
            arguments.record,
            tls=tls_of(arguments),
            sign_in=_sign_in(arguments),
            monitors=arguments.monitors,
            notify=_notify(arguments),
            foxglove=arguments.foxglove,
            is_in_fleet=arguments.is_in_fleet,
            metrics=_metrics(arguments),
        ),
        is_simulated=arguments.simulate,
        on_ready=print_entrance,
        given=given,
        is_dev=arguments.dev,
        faults=arguments.faults,
    )


def _add_others(parser: argparse.ArgumentParser) -> None:
    """Declare the options for other servers: the fleet and metrics."""
    parser.add_argument(
        "--fleet",
        dest="is_in_fleet",
        action="store_true",
        help="join the fleet of this data folder: its robots appear here, and these robots there;"
        " see 'urc fleet'",
    )
    parser.add_argument(
        "--metric",
        dest="metrics",
        metavar="ROBOT.SIGNAL",
        action="append",
        default=[],
        help="add this reading to /metrics; * stands for all robots or all signals, as in"
        " '*.battery'; repeatable",
    )


def _add_sign_in(parser: argparse.ArgumentParser) -> None:
    """Declare the options for sign-in methods; `_sign_in` reads these options."""
    parser.add_argument(
        "--oidc",
        metavar="FILE",
        help="file that describes the OpenID Connect provider for sign-ins: see docs/sign-in.md",
    )
    parser.add_argument(
        "--trust-proxy",
        dest="proxies",
        metavar="FILE",
        action="append",
        default=[],
        help="file that describes a trusted proxy, which signs people in and sends their names"
        " in a header",
    )
    parser.add_argument(
        "--without-sign-in",
        dest="is_open",
        action="store_true",
        help="let everyone on the network watch and drive without a sign-in; each page shows a red"
        " warning",
    )


def _sign_in(arguments: argparse.Namespace) -> "SignInOptions":
    """Return the sign-in options from the command line.

    Raises:
        ProblemsError: a file contains mistakes.
    """
    from urc.access.oidc_options import read_oidc_options
    from urc.access.proxies import read_proxy_options
    from urc.web.people.ways_in import SignInOptions

    oidc = read_oidc_options(arguments.oidc) if arguments.oidc else None
    return SignInOptions(oidc, tuple(read_proxy_options(file) for file in arguments.proxies))


def _add_alarms(parser: argparse.ArgumentParser) -> None:
    """Declare the options for alarms; `_notify` reads the hook's file."""
    parser.add_argument(
        "--monitor-alarms",
        dest="monitors",
        action="store_true",
        help="keep all robots with alarms connected, to evaluate alarms even if no page is open",
    )
    parser.add_argument(
        "--notify-alarms",
        dest="notify",
        metavar="FILE",
        help="file with a command or URL that receives new alarms: see docs/alarms.md",
    )


def _notify(arguments: argparse.Namespace) -> "NotifyOptions | None":
    """Return the hook for alarm notifications, as described in the file of `--notify-alarms`.

    Raises:
        ProblemsError: the file contains mistakes.
    """
    if not arguments.notify:
        return None
    from urc.web.alarms.notify_options import read_notify_options

    return read_notify_options(arguments.notify)


def _metrics(arguments: argparse.Namespace) -> "list[ReadingChoice]":
    """Return the readings for metrics.

    Raises:
        UrcError: an option has a wrong form, or the extra is not installed.
    """
    if not arguments.metrics:
        return []
    from urc.web.metrics.metric_names import reading_choice
    from urc.web.metrics.routes import missing_package

    if text := missing_package():
        raise UrcError(text)
    try:
        return [reading_choice(one) for one in arguments.metrics]
    except UrcError as fault:
        raise Misuse(f"--metric: {fault}") from None


def _check(arguments: argparse.Namespace) -> None:
    """Reject contradictory arguments.

    Raises:
        Misuse: the arguments contradict each other, or a folder does not exist.
    """
    if arguments.dev and not is_loopback(arguments.host):
        raise Misuse(
            "--dev shows all traffic, so it is allowed only on this machine;"
            f" found --host {arguments.host}"
        )
    if arguments.is_open and is_loopback(arguments.host):
        raise Misuse("--without-sign-in is for other machines: add --host")
    if arguments.faults and not arguments.simulate:
        raise Misuse("--fault is for emulated robots: add --simulate")
    if arguments.tiles and not arguments.tiles.is_dir():
        raise Misuse(f"--tiles requires a folder of map tiles; {arguments.tiles} is not a folder")
    if arguments.record:
        from urc.runtime.recording.recorder import check_installed

        check_installed()  # reported now, not when an operator drives


def _warn(arguments: argparse.Namespace) -> None:
    if arguments.is_open:
        complain(
            f"urc serve: {arguments.host} is reachable from other machines without a sign-in:"
            " anyone on the network can drive these robots"
        )
    if not arguments.has_guard:
        complain(
            "urc serve: no guard process: if this process hangs, moving robots are not stopped"
        )
