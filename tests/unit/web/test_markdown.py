"""Markdown of a profile's author: what is rendered, and what stays text."""

import pytest

from urc.web.show.sandbox import markdown


def test_a_text_is_rendered_below_the_headings_of_its_cell() -> None:
    """The first level of heading is the fourth of the page; tables and lists are there."""
    html = markdown("# Go\n\n###### low\n\n- **now**\n\n| a |\n|---|\n| ~~b~~ |\n")
    assert "<h4>Go</h4>" in html
    assert "<h6>low</h6>" in html
    assert "<li><strong>now</strong></li>" in html.replace("\n", "")
    assert "<td><s>b</s></td>" in html


def test_a_link_opens_beside_the_page() -> None:
    """The page that drives stays."""
    html = markdown("[m](https://example.org/a?b&c) <https://example.org>")
    assert html.count('target="_blank" rel="noopener noreferrer"') == 2
    assert 'href="https://example.org/a?b&amp;c"' in html


@pytest.mark.parametrize(
    "text",
    [
        "<script>alert(1)</script>",
        "<img src=x onerror=alert(1)>",
        "a <b onclick=alert(1)>b</b>",
        "[a](javascript:alert(1))",
        "[a](data:text/html,x)",
        "[a](vbscript:x)",
        '[a](https://x "\\" onclick=alert(1)")',
        "![a](https://x/y.png)",
    ],
)
def test_nothing_of_the_text_becomes_markup_of_its_own(text: str) -> None:
    """HTML, scripts in links, attributes and pictures: they are shown, or lead nowhere."""
    html = markdown(text)
    for tag in ("<script", "<img", "<b ", 'href="javascript', 'href="data', 'href="vbscript'):
        assert tag not in html
    assert " onclick=" not in html.replace("&quot; onclick=alert(1)", "").replace(
        "&lt;b onclick=", ""
    )
