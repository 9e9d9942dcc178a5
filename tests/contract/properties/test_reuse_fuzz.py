"""Whatever stands in documents that build on each other: findings come of it, no exception."""

import copy
import json
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.config.load import check
from urc.config.parse.widget import WidgetFolder
from urc.config.resolve import resolve, written
from urc.runtime.registries import built_in_catalog
from urc.source import read_document

ROOT = Path(__file__).resolve().parents[3]
EVERY_KEY = ROOT / "tests" / "contract" / "every_key"
NAMES = (
    "driver-of-parts", "part-of-driver", "robot-of-parts", "part-of-robot", "driver-that-extends",
)  # fmt: skip
DOCUMENTS = {name: read_document(str(EVERY_KEY / f"{name}.yaml")).data for name in NAMES}

WORDS = (
    "{i}", "{params.side}", "{params.x}", "{m.id}", "{m}", "a_{i}", "{{ i }}", "each", "remove",
    "name", "joint_1", "charge", "wire", "tcp", "1s", "driver-of-parts.yaml", "",
)  # fmt: skip
words = st.sampled_from(WORDS)
anything = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 300) | st.floats(allow_nan=False) | words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=6,
)


@given(data=st.data())
@settings(max_examples=examples(40), deadline=None)
def test_no_change_of_the_documents_raises(data: st.DataObject, tmp_path_factory: Any) -> None:
    """Two changes anywhere: each document is checked, and put together where that is possible."""
    folder = tmp_path_factory.getbasetemp() / "reuse-fuzz"
    folder.mkdir(exist_ok=True)
    changed = copy.deepcopy(DOCUMENTS)
    for _ in range(2):
        place: Any = changed[data.draw(st.sampled_from(NAMES))]
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            key = data.draw(st.sampled_from(keys))
            if (
                not isinstance(place[key], (dict, list))
                or not place[key]
                or data.draw(st.booleans())
            ):
                break
            place = place[key]
        if isinstance(place, dict) and data.draw(st.booleans()):
            place[data.draw(words)] = place.pop(key)
        else:
            place[key] = data.draw(anything)
        if not all(changed.values()):
            return
    for name, document in changed.items():
        text = "".join(written(key, value) for key, value in document.items())  # type: ignore[union-attr]
        (folder / f"{name}.yaml").write_text(text, "utf-8")
    registry = WidgetFolder(EVERY_KEY / "shelf")
    for name in ("robot-of-parts", "driver-that-extends"):
        file = str(folder / f"{name}.yaml")
        for problem in check(file, built_in_catalog(), registry).problems:
            assert problem.line >= 1
            assert problem.column >= 1
            source = Path(problem.file).read_text("utf-8").splitlines() if problem.source else []
            assert not problem.source or source[problem.line - 1] == problem.source
        assert json.dumps(resolve(file, registry).text)
