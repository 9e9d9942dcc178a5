"""The settings of one robot as its page shows them: a field for each, by the type of its value.

Floor 5. Pure: what is in a field is decided here, what becomes of it in
`urc.web.manage.settings_routes`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

from urc.model.profile import Profile, Setting
from urc.model.values import Value
from urc.runtime.kept import Kept
from urc.web.show.cells import spoken
from urc.web.show.menu import Nav, Ways
from urc.web.show.pages import Head, render
from urc.web.words import t

__all__ = ["Field", "Option", "SettingsPage", "settings_page"]

_INPUTS: Final = {
    "string": ("text", ""),
    "host": ("text", "url"),
    "port": ("text", "numeric"),
    "integer": ("text", "numeric"),
    "number": ("text", "decimal"),
    "path": ("text", ""),
}
"""Type of a setting → type of its field, and which keys a phone shows. Numbers are text, too: a
field of type number hides what it does not understand."""


@dataclass(frozen=True, slots=True)
class Option:
    """One choice of several."""

    value: str
    title: str
    is_chosen: bool


@dataclass(frozen=True, slots=True)
class Field:
    """One setting."""

    name: str
    title: str
    about: str
    """What it is, with its range and default."""
    kind: str
    """``text``, ``password``, ``choice`` or ``switch``."""
    keys: str
    """``inputmode``; "" for the usual."""
    value: str
    """As filled in; of a secret never."""
    placeholder: str
    """What counts where nothing is filled in."""
    options: tuple[Option, ...]
    is_given: bool
    """It was given at the start, and cannot be changed here."""
    is_set: bool
    """A secret: whether there is one."""
    is_withheld: bool
    """A secret that is there and not used: it was entered for another destination."""


@dataclass(frozen=True, slots=True)
class SettingsPage:
    """``settings.html.j2``: driver, interface, and the driver's own settings."""

    head: Head
    nav: Nav
    name: str
    title: str
    url: str
    """Of the robot's own page."""
    post_url: str
    driver: str
    versions: tuple[Option, ...]
    """Installed versions of the driver; empty when it is a file."""
    interfaces: tuple[Option, ...]
    fields: tuple[Field, ...]
    transports: tuple[str, ...]
    """Names of the lines that a test tries."""
    may_manage: bool
    is_simulated: bool
    fault: str
    """Why the robot cannot be used; "" when it can."""


def settings_page(
    nonce: str,
    name: str,
    profile: Profile,
    kept: Kept,
    given: Mapping[str, Value],
    *,
    withheld: Collection[str] = (),
    ways: Ways,
    driver: str,
    versions: Sequence[str],
    may_manage: bool,
    fault: str = "",
) -> str:
    """Return the page.

    Args:
        nonce: of this response.
        name: of the robot in its URL.
        profile: what it is, with all its interfaces.
        kept: what was filled in before.
        given: settings that were given at the start.
        withheld: secrets that are not used, since they were entered for another destination.
        ways: which pages there are.
        driver: what it is driven with.
        versions: installed versions of it, the newest first.
        may_manage: whether who asks may change anything.
        fault: why the robot cannot be used.
    """
    title = profile.title or name
    place = quote(name, safe="")
    page = SettingsPage(
        head=Head(nonce, t("Settings of {title}", title=title)),
        nav=Nav("", ways),
        name=name,
        title=title,
        url=f"/robots/{place}/",
        post_url=f"/api/v1/robots/{place}/settings",
        driver=driver,
        versions=_versions(versions, kept.version),
        interfaces=_interfaces(profile, kept.interface),
        fields=tuple(_field(one, kept, given, withheld) for one in profile.settings.values()),
        transports=tuple(profile.driver.transports),
        may_manage=may_manage,
        is_simulated=False,
        fault=fault,
    )
    return render("settings.html.j2", page)


def _versions(versions: Sequence[str], chosen: str) -> tuple[Option, ...]:
    if not versions:
        return ()
    newest = Option("", t("the newest ({version})", version=versions[0]), chosen not in versions)
    return (newest, *(Option(one, one, one == chosen) for one in versions))


def _interfaces(profile: Profile, chosen: str) -> tuple[Option, ...]:
    names = list(profile.interfaces)
    shown = chosen if chosen in names else next(iter(names), "")
    return tuple(
        Option(name, one.title or name, name == shown) for name, one in profile.interfaces.items()
    )


def _field(
    setting: Setting, kept: Kept, given: Mapping[str, Value], withheld: Collection[str]
) -> Field:
    is_given = setting.name in given
    text = kept.settings.get(setting.name, "")
    if is_given and not setting.is_secret:
        text = _text(given[setting.name])
    default = "" if setting.default is None else _text(setting.default)
    kind, keys = _INPUTS.get(setting.type, ("text", ""))
    options: tuple[Option, ...] = ()
    if setting.is_secret:
        kind, text = "password", ""
    elif setting.type == "choice":
        kind, options = "choice", _choices(setting.choices, text, default)
    elif setting.type == "boolean":
        kind = "choice"
        options = _choices(("true", "false"), text, default, {"true": t("yes"), "false": t("no")})
    return Field(
        name=setting.name,
        title=setting.title or spoken(setting.name),
        about=_about(setting),
        kind=kind,
        keys=keys,
        value=text,
        placeholder=default or ("" if setting.is_required else t("may stay empty")),
        options=options,
        is_given=is_given,
        is_set=is_given or (setting.name in kept.settings and setting.name not in withheld),
        is_withheld=setting.name in withheld,
    )


def _choices(
    values: Sequence[str], chosen: str, default: str, titles: Mapping[str, str] | None = None
) -> tuple[Option, ...]:
    called = titles or {}
    usual = (
        t("as the driver says ({value})", value=called.get(default, default))
        if default
        else t("not set")
    )
    first = Option("", usual, chosen not in values)
    return (first, *(Option(one, called.get(one, one), one == chosen) for one in values))


def _about(setting: Setting) -> str:
    parts = [setting.description.rstrip(".")] if setting.description else []
    low, high = setting.min, setting.max
    if setting.type == "port":
        parts.append(t("a port, 1 to 65535"))
    elif setting.type == "host":
        parts.append(t("a name or an address, such as 192.168.1.20"))
    elif setting.type == "path":
        parts.append(t("the full path of a file on the machine that runs URC"))
    elif low is not None and high is not None:
        parts.append(t("{low} to {high}", low=f"{low:.15g}", high=f"{high:.15g}"))
    elif low is not None:
        parts.append(t("at least {low}", low=f"{low:.15g}"))
    elif high is not None:
        parts.append(t("at most {high}", high=f"{high:.15g}"))
    return "; ".join(parts)


def _text(value: Value) -> str:
    """Return a value as it is typed."""
    return str(value).lower() if isinstance(value, bool) else str(value)
