"""Whatever is typed into a pipeline file, the answer is a pipeline or a list of places in it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.pipeline.load import PipelineError, load

DATA = Path(__file__).parents[1] / "data"
GOOD = (DATA / "rig.yaml").read_text()
SCRAPS = (
    *("{", "}", "[", "]", ":", " ", "\n", "\n  ", "- ", "? ", "&a", "*a", "!", "|", ">", "'", '"'),
    *("#", "%", "null", "~", "-1", "1e999", ".nan", "true", "\t", "é", "\0", "<<: ", "---", "..."),
    *("99999999999999999999", "\ufeff", "\x85", "name", "nodes:", "params: ", "status/x", "run: "),
)
CUTS = st.lists(
    st.tuples(
        st.integers(0, len(GOOD)),
        st.integers(0, 40),
        st.sampled_from(SCRAPS) | st.text(max_size=8),
    ),
    min_size=1,
    max_size=4,
)


@given(cuts=CUTS)
@settings(max_examples=150, deadline=None)
def test_mangled_file_is_read_or_refused_with_places_in_it(
    cuts: list[tuple[int, int, str]],
) -> None:
    text = GOOD
    for start, length, scrap in cuts:
        text = text[:start] + scrap + text[start + length :]
    with TemporaryDirectory() as folder:
        (Path(folder) / "nodes").symlink_to(DATA / "nodes")
        file = Path(folder) / "pipeline.yaml"
        file.write_text(text, newline="")
        try:
            assert load(file).nodes
        except PipelineError as error:
            lines = len(text.splitlines()) + 1
            assert error.faults
            for fault in error.faults:
                assert fault.file == str(file) and fault.text
                whole = (fault.line, fault.column) == (0, 0)
                assert whole or (1 <= fault.line <= lines and fault.column >= 1), str(fault)
