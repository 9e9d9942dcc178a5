"""The ONVIF profile sends the requests that another client sends (npm `onvif`)."""

import json
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from scripts.node import node_executable

HERE = Path(__file__).parent
PAGE = (HERE.parents[1] / "docs" / "how-to" / "onvif.md").read_text("utf-8")
NODE_TIMEOUT_S = 60
BODY = "{http://www.w3.org/2003/05/soap-envelope}Body"


def body(envelope: str) -> ElementTree.Element:
    """Return the request in a SOAP envelope."""
    found = ElementTree.fromstring(envelope).find(BODY)  # noqa: S314 - from this repository
    assert found is not None
    (request,) = found
    return request


@pytest.mark.needs("node")
@pytest.mark.needs("onvif")
def test_each_request_equals_that_of_another_client() -> None:
    """The profile's own tests, which `urc validate` runs, contain each request."""
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    steps = yaml.safe_load(block)["tests"][0]["steps"]
    ours = {}
    for step in steps:
        if "sent" in step:
            request = body(step["sent"]["device"]["request"]["text"])
            ours[request.tag.partition("}")[2]] = ElementTree.canonicalize(
                ElementTree.tostring(request, "unicode"), rewrite_prefixes=True
            )
    node = node_executable()
    assert node is not None
    done = subprocess.run(
        [node, str(HERE / "onvif_requests.mjs")],
        capture_output=True, text=True, timeout=NODE_TIMEOUT_S, check=True,
    )  # fmt: skip
    theirs = {
        name: ElementTree.canonicalize(
            ElementTree.tostring(body(text), "unicode"), rewrite_prefixes=True
        )
        for name, text in json.loads(done.stdout).items()
    }
    assert ours == theirs
    assert len(ours) == 7
