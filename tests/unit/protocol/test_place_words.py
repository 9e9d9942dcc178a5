"""Values in paths and topics: one word of their place, and never the way to another one."""

import pytest

from urc.expressions import compile_template
from urc.protocol.forms.envelope import place_writer
from urc.protocol.values.payload import NotWritable
from urc.transports.http_client import leads_up

NAMES = {"what": "", "n": 7, "settings": {"base": "/api/v2", "space": "lab/rover"}}


def written(name: str, template: str, what: object = "") -> str:
    """Return a place with the value `what` in it."""
    place = place_writer(name, compile_template(template))
    assert place is not None
    return place.write({**NAMES, "what": what})


@pytest.mark.parametrize(
    ("template", "what", "path"),
    [
        ("/x/{{ what }}", "plain", "/x/plain"),
        ("/x/{{ what }}", "a?b=c&d#e", "/x/a%3Fb%3Dc%26d%23e"),
        ("/x/{{ what }}", "a/b", "/x/a%2Fb"),
        ("/x/{{ what }}", "Zürich 1%", "/x/Z%C3%BCrich%201%25"),
        ("/x/{{ what }}", "..;/", "/x/..%3B%2F"),
        ("/x/{{ what }}", "%2e%2e", "/x/%252e%252e"),
        ("/x/{{ n }}/{{ what }}", "y", "/x/7/y"),
        ("/x?q={{ what }}", "a&admin=1", "/x?q=a%26admin%3D1"),
        ("{{ settings.base }}/{{ what }}", "led", "/api/v2/led"),
        ("{{ what }}", "/led/on", "/led/on"),
        ("{{ what }}", "/led?x", "/led%3Fx"),
    ],
)
def test_a_value_is_one_part_of_a_path(template: str, what: str, path: str) -> None:
    """Only what stands for the whole path has parts, and no value makes a query."""
    assert written("path", template, what) == path


@pytest.mark.parametrize(
    ("template", "what"),
    [("/x/{{ what }}", ".."), ("/x/{{ what }}/y", "."), ("{{ what }}", "../../admin")],
)
def test_a_value_that_leads_up_is_not_written(template: str, what: str) -> None:
    with pytest.raises(NotWritable, match="would change the path"):
        written("path", template, what)


@pytest.mark.parametrize("name", ["topic", "service", "action"])
@pytest.mark.parametrize("what", ["+", "#", "a/b", "a\0b"])
def test_a_value_in_a_name_leads_to_no_other(name: str, what: str) -> None:
    """Wildcards, separators and NUL would."""
    with pytest.raises(NotWritable, match=f"would change the {name}"):
        written(name, "cmnd/{{ what }}/POWER", what)


def test_a_value_that_is_the_whole_name_may_have_levels() -> None:
    """A list of topics to choose from has them; wildcards mean nothing there, either."""
    assert written("topic", "{{ what }}", "/rover/cmd_vel") == "/rover/cmd_vel"
    with pytest.raises(NotWritable):
        written("topic", "{{ what }}", "/rover/#")


def test_what_the_operator_has_set_is_as_good_as_written() -> None:
    """So it is left as it is."""
    assert place_writer("topic", compile_template("{{ settings.space }}/odom")) is None
    assert written("topic", "{{ settings.space }}/{{ what }}", "odom") == "lab/rover/odom"
    assert place_writer("query", compile_template("{{ what }}")) is None


@pytest.mark.parametrize(
    ("path", "leads"),
    [
        ("/led/on", False),
        ("/v1.2/...", False),
        ("/led?next=../x", False),
        ("/led/../admin", True),
        ("/led/.", True),
        ("/led/%2e%2E/admin", True),
        ("/led/%252e%252e/admin", True),
        ("/led\\..\\admin", True),
        ("..", True),
    ],
)
def test_no_path_leaves_the_folder_of_the_url(path: str, leads: bool) -> None:
    """However it is packed; the last look is the transport's."""
    assert leads_up(path) is leads
