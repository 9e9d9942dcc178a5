"""Every route of the dashboard, the errors too: page policy, assets, markup, contrast."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.testclient import TestClient

from urc.model.interface import WidgetUse
from urc.model.profile import Setting
from urc.problems import UrcError
from urc.testing.dashboard import FakeRobot, dashboard_profile, plain_widget
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

ROOT = Path(__file__).resolve().parents[2]
STATIC = ROOT / "urc" / "web" / "static"

HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(1)>{{ 7*7 }}'

CONTENT_POLICY = (
    "default-src 'none'; script-src 'nonce-NONCE' 'strict-dynamic'; "
    "style-src 'self' 'nonce-NONCE'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; frame-src 'self'; worker-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; "
    "form-action 'none'; "
    "object-src 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; "
    "trusted-types urc"
)


def dashboard() -> Starlette:
    """Return the app with a robot that is ready, one that isn't, and one with hostile texts."""
    ready = FakeRobot(dashboard_profile())
    needy = FakeRobot(
        dashboard_profile(
            name="needy",
            settings={
                "host": Setting("host", "host"),
                "key": Setting("key", "string", default="hush", is_secret=True),
            },
        )
    )
    title = WidgetUse("battery", "battery", {"level": "battery"}, title=HOSTILE)
    hostile = FakeRobot(dashboard_profile(name="hostile", uses=(title,)))
    hostile.profile = hostile.profile._replace(title=HOSTILE, summary=HOSTILE)
    robots = {
        name: Robot(robot.profile, {}, robot.open)
        for name, robot in {"puppet": ready, "needy": needy, "hostile": hostile}.items()
    }
    return build_app(robots, DashboardOptions(access=ACCESS, allowed_hosts=["robot-pi"]))


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    """Talk to the app as a browser on this machine."""
    with TestClient(
        dashboard(),
        base_url="http://localhost:8080",
        cookies=HERE,
        follow_redirects=False,
        raise_server_exceptions=False,
    ) as started:
        yield started


ROUTES = [
    ("GET", "/", 200),
    ("HEAD", "/", 200),
    ("GET", "/robots/puppet/", 200),
    ("GET", "/robots/puppet/?interface=default", 200),
    ("GET", "/robots/puppet", 307),
    ("GET", "/robots/needy/", 303),
    ("GET", "/robots/nobody/", 404),
    ("GET", "/robots/puppet/?interface=nope", 404),
    ("GET", "/healthz", 200),
    ("GET", "/favicon.ico", 200),
    ("GET", "/static/core/app.css", 200),
    ("GET", "/static/live/main.js", 200),
    ("GET", "/static/nope.js", 404),
    ("GET", "/vendor/nope.js", 404),
    ("GET", "/widgets/battery/widget.js", 200),
    ("GET", "/widgets/battery/widget.css", 200),
    ("GET", "/widgets/battery/widget.yaml", 404),
    ("GET", "/widgets/battery/template.html.j2", 404),
    ("GET", "/widgets/nope/widget.js", 404),
    ("GET", "/nope", 404),
    ("POST", "/", 403),
    ("GET", "/ws", 404),
]


@pytest.mark.parametrize(("method", "path", "status"), ROUTES)
def test_every_answer_carries_the_page_policy(
    client: TestClient, method: str, path: str, status: int
) -> None:
    """Pages, files, redirects, refusals: all of them, with a nonce of their own."""
    answer = client.request(method, path)
    assert answer.status_code == status
    folder = path.split("/")[1]
    is_file = status == 200 and folder == "widgets" and path.count("/") > 2
    check_policy(dict(answer.headers), is_file=is_file)


def check_policy(headers: dict[str, str], *, is_file: bool = False) -> None:
    """Check the headers of one answer."""
    policy = headers["content-security-policy"]
    nonce = re.search(r"'nonce-([\w-]{20,})'", policy)
    assert nonce is not None
    sandbox = "sandbox; " if is_file else ""
    assert policy.replace(nonce[1], "NONCE") == sandbox + CONTENT_POLICY
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cross-origin-opener-policy"] == "same-origin"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "camera=()" in headers["permissions-policy"]
    assert "access-control-allow-origin" not in headers


@pytest.mark.parametrize(
    ("headers", "method", "status"),
    [
        ({"host": "evil.example"}, "GET", 421),
        ({"host": "robot-pi:8080"}, "GET", 200),
        ({"origin": "http://evil.example"}, "POST", 403),
        ({"origin": "http://localhost:8080"}, "POST", 405),
        ({"origin": "http://localhost:8080", "content-length": "2000000"}, "POST", 413),
    ],
)
def test_refusals_carry_the_page_policy(
    client: TestClient, headers: dict[str, str], method: str, status: int
) -> None:
    """What the policy itself refuses is answered under it as well."""
    answer = client.request(method, "/", headers=headers)
    assert answer.status_code == status
    check_policy(dict(answer.headers))


def test_a_bug_is_told_in_one_sentence_under_the_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unexpected error shows no trace of the code, and carries the headers."""

    def broken(*_: object) -> str:
        raise ValueError("secret detail")

    monkeypatch.setattr("urc.web.app.menu_page", broken)
    with TestClient(
        dashboard(), base_url="http://localhost", cookies=HERE, raise_server_exceptions=False
    ) as client:
        answer = client.get("/")
    assert answer.status_code == 500
    assert "secret detail" not in answer.text
    assert "URC had an internal error" in answer.text
    check_policy(dict(answer.headers))


class Page(HTMLParser):
    """Collects what a page would run, load or point at."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep the element."""
        self.elements.append((tag, dict(attrs)))


@pytest.mark.parametrize("path", ["/", "/robots/puppet/", "/robots/hostile/", "/nope"])
def test_pages_run_and_load_only_what_is_ours(client: TestClient, path: str) -> None:
    """Scripts and styles have the nonce; no handler, no style attribute, no other host."""
    answer = client.get(path)
    policy = answer.headers["content-security-policy"]
    for tag, attributes in Page(answer.text).elements:
        if tag in ("script", "style"):
            assert f"'nonce-{attributes['nonce']}'" in policy
        assert not [name for name in attributes if name.startswith("on") or name == "style"]
        for name in ("src", "href", "action"):
            assert (attributes.get(name) or "/").startswith(("/", "#"))
    assert "http://" not in answer.text.replace("http://www.w3.org/2000/svg", "")


def test_texts_of_documents_are_text(client: TestClient) -> None:
    """A title that is markup is shown as it is written, and no template runs in it."""
    for path in ("/", "/robots/hostile/"):
        page = client.get(path).text
        assert "<script>alert" not in page
        assert "<img src=x" not in page
        assert "&lt;img src=x onerror=alert(1)&gt;{{ 7*7 }}" in page


def test_the_menu_names_the_settings_that_are_missing(client: TestClient) -> None:
    """A robot that cannot be connected is no link, and says why; secrets are not shown."""
    page = client.get("/").text
    card = page[page.index("Needy") :]
    assert "Not set yet: Host." in " ".join(card.split())
    assert "--set host=…" in card
    assert 'href="/robots/needy/"' not in page
    assert "hush" not in page
    assert 'href="/robots/puppet/"' in page


def test_files_are_kept_until_they_change(client: TestClient) -> None:
    """A browser asks each time, and gets no second copy."""
    first = client.get("/static/live/main.js")
    assert first.headers["cache-control"] == "no-cache"
    assert first.headers["content-type"] == "text/javascript; charset=utf-8"
    again = client.get("/static/live/main.js", headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get("/static/favicon.svg").headers["content-type"] == "image/svg+xml"
    assert client.get("/").headers["cache-control"] == "no-store"


TRAVERSALS = [
    "/static/../app.py",
    "/static/..%2fapp.py",
    "/static/%2e%2e/app.py",
    "/static/%2e%2e%2fapp.py",
    "/static/..%5capp.py",
    "/static/..\\app.py",
    "/static//etc/passwd",
    "/static/%2fetc%2fpasswd",
    "/static/live/main.js%00.css",
    "/static/live/main.js/",
    "/static/MAIN.JS",
    "/static/C:%5cWindows%5cwin.ini",
    "/static/CON",
    "/static/%5c%5chost%5cshare",
    "/static/",
    "/vendor/../app.py",
    "/vendor/%2e%2e/__init__.py",
    "/vendor/__init__.py",
    "/widgets/../pyproject.toml",
    "/widgets/battery/../battery/widget.js/../x",
    "/widgets/battery/..%2fvalue%2fwidget.js",
    "/widgets/battery/%2e%2e/%2e%2e/pyproject.toml",
    "/widgets/battery%2f..%2f..%2fpyproject.toml",
    "/widgets/battery/demo.yaml",
]


@pytest.mark.parametrize("path", TRAVERSALS)
def test_no_path_leads_out_of_what_is_served(client: TestClient, path: str) -> None:
    """A name is looked up, never joined to a folder."""
    assert client.get(path).status_code == 404


def test_the_import_map_leads_to_files_that_are_served(client: TestClient) -> None:
    """Every module that a widget may import is there, ours and others'."""
    page = client.get("/robots/puppet/").text
    found = re.search(r'type="importmap">(\{.*?\})</script>', page)
    assert found is not None
    addresses = [
        address for address in re.findall(r'"(/[^"]+)"', found[1]) if not address.endswith("/")
    ]
    assert len(addresses) > 10
    assert all(client.get(address).status_code == 200 for address in addresses)


def test_health_is_short(client: TestClient) -> None:
    """Whether it runs, and what it is."""
    from urc import __version__

    assert client.get("/healthz").json() == {"status": "ok", "version": __version__}


def test_two_different_widgets_of_one_name_are_refused(tmp_path: Path) -> None:
    """Which of them a page would get must not depend on the order of the robots."""
    own = plain_widget("battery", ["level"], folder=tmp_path)
    first, second = FakeRobot(dashboard_profile()), FakeRobot(dashboard_profile(widgets=[own]))
    robots = {
        name: Robot(robot.profile, {}, robot.open)
        for name, robot in {"a": first, "b": second}.items()
    }
    with pytest.raises(UrcError) as caught:
        build_app(robots)
    assert "two robots use different widgets named 'battery'" in str(caught.value)


def test_a_dashboard_without_robots_says_what_to_do() -> None:
    """It is not an empty page."""
    with TestClient(
        build_app({}, DashboardOptions(access=ACCESS)), base_url="http://localhost", cookies=HERE
    ) as client:
        assert "urc serve" in client.get("/").text


def test_scripts_write_no_markup_and_files_stay_short() -> None:
    """Robot text reaches the page as text only; one concept a file.

    A foreign widget's template, which the server has rendered, goes into its frame as markup.
    """
    for path in (*STATIC.rglob("*.js"), *(ROOT / "widgets").glob("*/*.js")):
        text = path.read_text("utf-8")
        assert text.startswith("// @ts-check"), path
        written = re.findall(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(", text)
        assert written == (["innerHTML"] if path == STATIC / "frame/frame.js" else []), path
        assert len(text.splitlines()) <= 600, path


THEMES = {
    "light": (4.5, 0),
    "dark": (4.5, 1),
    "sunlight": (7.0, None),
    "night": (4.5, None),
}


SERIES = tuple(f"series-{number}" for number in range(1, 7))


def theme_colours(name: str) -> dict[str, str]:
    """Return token → hex colour of a theme, read from the style sheet."""
    css = (STATIC / "core/tokens.css").read_text("utf-8")
    number = THEMES[name][1]
    if number is not None:
        pairs = re.findall(r"--urc-([\w-]+): light-dark\((#\w{6}), (#\w{6})\);", css)
        fixed = dict(re.findall(r"--urc-([\w-]+): (#\w{6});", css.split("[data-theme=")[0]))
        return fixed | {token: colours[number] for token, *colours in pairs}
    block = css.split(f'[data-theme="{name}"] {{')[1].split("}")[0]
    return dict(re.findall(r"--urc-([\w-]+): (#\w{6});", block))


def luminance(colour: str) -> float:
    """Return WCAG's relative luminance."""
    parts = [int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("theme", THEMES)
def test_each_theme_can_be_read(theme: str) -> None:
    """Text 4.5:1 (7:1 in sunlight) on every surface it stands on; graphics 3:1."""
    colours = theme_colours(theme)
    least = THEMES[theme][0]

    def contrast(one: str, other: str) -> float:
        bright, dark = sorted((luminance(colours[one]), luminance(colours[other])), reverse=True)
        return (bright + 0.05) / (dark + 0.05)

    faults = [
        f"{token} on {ground}: {contrast(token, ground):.2f}"
        for token in ("text", "muted", "old", "alarm", "caution")
        for ground in ("surface", "raised")
        if contrast(token, ground) < least
    ]
    faults += [
        f"{token} on {ground}: {contrast(token, ground):.2f}"
        for token in ("line", "focus", "level", "alarm", "caution", "danger", *SERIES)
        for ground in ("surface", "raised", "ground")
        if contrast(token, ground) < 3
    ]
    assert faults == []
    pairs = [
        ("on-accent", "accent"),
        ("ground", "text"),
        ("on-stop", "stop"),
        ("on-stop", "stop-pressed"),
    ]
    assert [pair for pair in pairs if contrast(*pair) < least] == []


def blended(over: str, below: str, share: float) -> str:
    """Return the colour of `over` with the opacity `share` on `below`."""
    parts = (
        round(int(over[at : at + 2], 16) * share + int(below[at : at + 2], 16) * (1 - share))
        for at in (1, 3, 5)
    )
    return "#" + "".join(f"{part:02x}" for part in parts)


@pytest.mark.parametrize("theme", THEMES)
def test_old_values_can_be_read_on_the_lines_of_their_hatching(theme: str) -> None:
    """Text 4.5:1 also where a letter lies on a line; an old value has the colour of muted text."""
    css = (STATIC / "live/lost.css").read_text("utf-8")
    share = int(re.findall(r"color-mix\(in srgb, var\(--urc-line\) (\d+)%", css)[0]) / 100
    colours = theme_colours(theme)
    names = ["text", "alarm", "caution", *([] if theme == "night" else ["muted"])]
    line = luminance(blended(colours["line"], colours["surface"], share))
    for name in names:
        bright, dark = sorted((luminance(colours[name]), line), reverse=True)
        assert (bright + 0.05) / (dark + 0.05) >= 4.5, name
