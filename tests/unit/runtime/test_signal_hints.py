"""The hint about an incomplete frame names its missing part."""

import pytest

from urc.model.driver import FramingSpec
from urc.model.profile import DocumentTest
from urc.runtime.document_tests import exercise
from urc.testing.profile import line_profile

WAITING = {
    "xml": (FramingSpec("xml", {}), "<a>4", "for the end of the XML element"),
    "json": (FramingSpec("json", {}), "[4", "for the end of the JSON value"),
    "regex": (
        FramingSpec("regex", {"pattern": "[0-9]+;"}),
        "4",
        "for bytes that match the pattern",
    ),
}


@pytest.mark.parametrize("name", WAITING)
def test_an_incomplete_frame_waits_for_its_missing_part(name: str) -> None:
    framing, fed, missing = WAITING[name]
    profile = line_profile()
    wire = profile.driver.transports["wire"]
    wire = wire._replace(framing=framing._replace(sent=wire.framing))
    driver = profile.driver._replace(transports={"wire": wire})
    test = DocumentTest("it works", 7, feed={"wire": fed}, reply_to=0, expect={"battery": 4})

    (problem,) = exercise(profile._replace(driver=driver, tests=(test,))).problems

    assert f"{fed!r} waits {missing}" in problem.message
