"""Data for a robot's settings page; each setting has one form field, chosen by its type.

Layer 5. This module fills the fields, and `urc.web.manage.settings_routes` reads their values.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

from urc.model.profile import Profile, Setting
from urc.model.values import Value
from urc.runtime.settings_store import StoredSettings
from urc.web.manage.setting_groups import CONNECTION, FURTHER, groups_of
from urc.web.show.cells import spoken
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["Field", "FieldGroup", "Option", "SettingsPage", "settings_page"]

_INPUTS: Final = {
    "string": ("text", ""),
    "host": ("text", "url"),
    "port": ("text", "numeric"),
    "integer": ("text", "numeric"),
    "number": ("text", "decimal"),
    "path": ("text", ""),
}
"""Type and on-screen keyboard of the form field, keyed by the setting's type. Numbers have text
fields, because browsers drop invalid input from number fields."""


@dataclass(frozen=True, slots=True)
class Option:
    """One option of a choice field."""

    value: str
    title: str
    is_chosen: bool


@dataclass(frozen=True, slots=True)
class Field:
    """The form field of one setting."""

    name: str
    title: str
    about: str
    """Description of the setting, including its range."""
    kind: str
    """Type of the field: ``text``, ``password`` or ``choice``."""
    keys: str
    """HTML ``inputmode`` of the field; "" for the default keyboard."""
    value: str
    """Entered value; always "" for a secret."""
    default: str
    """Value used while the field is empty; "" for a choice, whose first option says the default."""
    has_default: bool
    """Whether the driver has a default for the setting."""
    is_optional: bool
    """Whether the field may stay empty even without a default."""
    is_needed: bool
    """Whether the robot cannot connect until the field has a value."""
    options: tuple[Option, ...]
    is_given: bool
    """Whether the value is fixed because it was given when the server started."""
    is_set: bool
    """Whether a value is stored for the secret."""
    is_withheld: bool
    """Whether the stored secret is ignored because it was entered for another destination."""


@dataclass(frozen=True, slots=True)
class FieldGroup:
    """A group of form fields."""

    title: str
    fields: tuple[Field, ...]
    is_folded: bool
    """Whether the fields are hidden at first; false if any field has or needs an entered value."""


@dataclass(frozen=True, slots=True)
class SettingsPage:
    """Context for ``settings.html.j2``: the driver's settings, the driver and the interface."""

    head: PageHead
    nav: Nav
    name: str
    title: str
    url: str
    """URL of the robot's page."""
    post_url: str
    driver: str
    versions: tuple[Option, ...]
    """Installed versions of the driver; empty for a driver from a file."""
    interfaces: tuple[Option, ...]
    monitoring: tuple[Option, ...]
    """Choices for the monitoring of alarms; empty for a robot without alarms."""
    groups: tuple[FieldGroup, ...]
    transports: tuple[str, ...]
    """Names of the transports that a connection test opens."""
    may_manage: bool
    is_simulated: bool
    fault: str
    """Reason why the robot cannot be used; "" if it can."""


def settings_page(
    nonce: str,
    name: str,
    profile: Profile,
    kept: StoredSettings,
    given: Mapping[str, Value],
    *,
    withheld: Collection[str] = (),
    ways: NavigationLinks,
    driver: str,
    versions: Sequence[str],
    may_manage: bool,
    fault: str = "",
) -> str:
    """Return the HTML of the settings page.

    Args:
        nonce: nonce of the response's content security policy.
        name: the robot's name in URLs.
        profile: the robot's profile with all its interfaces.
        kept: the stored settings of the robot.
        given: settings given when the server started.
        withheld: names of unused secrets, which were entered for another destination.
        ways: navigation links of this server.
        driver: name of the driver package or driver file in use.
        versions: installed versions of the driver, newest first.
        may_manage: whether the visitor may change packages and settings.
        fault: reason why the robot cannot be used; "" if it can.
    """
    title = profile.title or name
    place = quote(name, safe="")
    page = SettingsPage(
        head=PageHead(nonce, t("Settings of {title}", title=title)),
        nav=Nav("settings", ways),
        name=name,
        title=title,
        url=f"/robots/{place}/",
        post_url=f"/api/v1/robots/{place}/settings",
        driver=driver,
        versions=_versions(versions, kept.version),
        interfaces=_interfaces(profile, kept.interface),
        monitoring=_monitoring(profile, kept.monitors_alarms),
        groups=tuple(
            _group(title, [_field(one, kept, given, withheld) for one in settings])
            for title, settings in groups_of(profile).items()
        ),
        transports=tuple(profile.driver.transports),
        may_manage=may_manage,
        is_simulated=False,
        fault=fault,
    )
    return render("settings.html.j2", page)


def _monitoring(profile: Profile, chosen: bool | None) -> tuple[Option, ...]:
    if all(one.limits.is_empty for one in profile.driver.signals.values()):
        return ()
    return (
        Option("", t("As set when this server was started"), chosen is None),
        Option("true", t("Always: stay connected"), chosen is True),
        Option("false", t("Only while a page is open"), chosen is False),
    )


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


def _group(title: str, fields: list[Field]) -> FieldGroup:
    words = {CONNECTION: t("Connection"), FURTHER: t("Further settings")}
    is_empty = not any(
        one.value or one.is_set or one.is_withheld or one.is_needed for one in fields
    )
    return FieldGroup(words.get(title, title), tuple(fields), title != CONNECTION and is_empty)


def _field(
    setting: Setting, kept: StoredSettings, given: Mapping[str, Value], withheld: Collection[str]
) -> Field:
    is_given = setting.name in given
    text = kept.settings.get(setting.name, "")
    if is_given and not setting.is_secret:
        text = _text(given[setting.name])
    default = "" if setting.default is None else _text(setting.default)
    is_set = is_given or (setting.name in kept.settings and setting.name not in withheld)
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
        default="" if options else default,
        has_default=bool(default) and not setting.is_secret,
        is_optional=not setting.is_missing(setting.default) and not default,
        is_needed=not is_set and setting.is_missing(setting.default),
        options=options,
        is_given=is_given,
        is_set=is_set,
        is_withheld=setting.name in withheld,
    )


def _choices(
    values: Sequence[str], chosen: str, default: str, titles: Mapping[str, str] | None = None
) -> tuple[Option, ...]:
    called = titles or {}
    usual = t("Default: {value}", value=called.get(default, default)) if default else t("not set")
    first = Option("", usual, chosen not in values)
    return (first, *(Option(one, called.get(one, one), one == chosen) for one in values))


def _about(setting: Setting) -> str:
    parts = [setting.description.rstrip(".")] if setting.description else []
    low, high = setting.min, setting.max
    if parts and setting.type in ("port", "host"):
        pass  # the author's words say more
    elif setting.type == "port":
        parts.append(t("A port, 1 to 65535"))
    elif setting.type == "host":
        parts.append(t("A name or an address, such as 192.168.1.20"))
    elif setting.type == "path":
        parts.append(t("The full path of a file on the machine that runs URC"))
    elif low is not None and high is not None:
        parts.append(t("From {low} to {high}", low=f"{low:.15g}", high=f"{high:.15g}"))
    elif low is not None:
        parts.append(t("At least {low}", low=f"{low:.15g}"))
    elif high is not None:
        parts.append(t("At most {high}", high=f"{high:.15g}"))
    return ". ".join(parts)


def _text(value: Value) -> str:
    """Return a setting's value as the text that a user would enter."""
    return str(value).lower() if isinstance(value, bool) else str(value)
