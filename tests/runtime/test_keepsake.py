"""A node's state on file: neither a full disk nor a state that it cannot take ends the node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from lodeline.keepsake import Keepsake
from lodeline.node import Context, Node


@dataclass(frozen=True, slots=True)
class Count:
    """How often, of something."""

    value: int


@dataclass(frozen=True, slots=True)
class NoParams:
    """Nothing to set."""


class Counter(Node[NoParams]):
    """Counts, and takes no count from ten on."""

    State = Count

    def setup(self) -> None:
        self.count = 0
        self.seen = {"the first"}

    def save(self) -> Count:
        return Count(self.count)

    def resume(self, state: Count) -> None:
        self.seen.add("half of a state")
        self.count = range(10)[state.value]


@pytest.fixture
def counter(tmp_path: Path) -> Counter:
    return Counter(NoParams(), Context(name="counter", run_folder=tmp_path))


def test_a_full_disk_is_told_once_and_keeps_the_state_before(
    counter: Counter, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keepsake = Keepsake(counter, tmp_path)
    counter.count = 3
    keepsake.store(keepsake.look({}))
    part = tmp_path / "counter.part"
    part.symlink_to("/dev/full")
    for counter.count in (4, 5):
        keepsake.store(keepsake.look({}))
    told = capsys.readouterr().err
    assert told.count("STATE_NOT_KEPT counter: ") == 1 and "No space left" in told
    counter.count = 0
    assert keepsake.restore() == {} and counter.count == 3
    part.unlink()
    counter.count = 5
    keepsake.store(keepsake.look({}))
    counter.count = 0
    assert keepsake.restore() == {} and counter.count == 5


def test_a_state_that_the_node_fails_over_is_lost_and_not_its_start(
    counter: Counter, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keepsake = Keepsake(counter, tmp_path)
    counter.count = 12
    keepsake.store(keepsake.look({"a": 1}))
    counter.count = 0
    assert keepsake.restore() is None and counter.count == 0
    assert "STATE_LOST counter: " in capsys.readouterr().err
    assert counter.seen == {"the first"}
