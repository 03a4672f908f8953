"""Claims about decoding: any bytes make a finite message, or raise what is documented."""

from __future__ import annotations

from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.bench import fuzz
from lodeline_msgs import MESSAGES, DecodeError, Message, unpack
from lodeline_msgs.codec import Cause


def test_thirty_thousand_mangled_payloads_raise_nothing_else() -> None:
    outcomes, culprit = fuzz.fuzz(30_000, seed=7)
    assert culprit is None, outcomes
    assert sum(outcomes.values()) == 30_000
    # Every way of being wrong was met, and so was being right; a class is named by the encoding.
    assert set(outcomes) == {"taken"} | {
        f"refused: {cause}" for cause in get_args(Cause) if cause != "another class"
    }
    assert all(count > 50 for count in outcomes.values())


@settings(max_examples=500, deadline=None)
@given(st.binary(max_size=300), st.sampled_from(sorted(MESSAGES)))
def test_any_bytes_are_refused_or_make_a_message(data: bytes, name: str) -> None:
    try:
        assert isinstance(unpack(data, MESSAGES[name]), Message)
    except DecodeError as error:
        assert str(error)
        assert error.cause in get_args(Cause)


@pytest.mark.parametrize("error", [KeyError("v"), UnicodeDecodeError("utf-8", b"\xff", 0, 1, "x")])
def test_the_fuzz_finds_a_decoder_that_raises_something_else(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(data: bytes, kind: type[Message]) -> Message:
        if data[:1] == b"\xc6":
            raise error
        return unpack(data, kind)

    monkeypatch.setattr(fuzz, "unpack", broken)
    outcomes, culprit = fuzz.fuzz(30_000, seed=7)
    assert culprit is not None
    assert culprit[1][:1] == b"\xc6"
    assert any(outcome.startswith("NOT DOCUMENTED") for outcome in outcomes)
