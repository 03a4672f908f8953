"""Nodes of one process, wired by direct calls."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from lodeline.graph import Graph
from lodeline.node import Context, Input, Node, Output
from lodeline_msgs import Message, WheelTicks


@dataclass(frozen=True, slots=True)
class NoParams:
    """Nothing to set."""


class Adder(Node[NoParams]):
    """Sends each count one higher; cannot take a left count of 13, and ends at 17."""

    ticks = Input(WheelTicks)
    more = Output(WheelTicks)

    @ticks.handler
    def on_ticks(self, ticks: WheelTicks) -> None:
        if ticks.left == 13:
            raise ValueError("no thirteen")
        if ticks.left == 17:
            sys.exit(2)
        self.more.send(WheelTicks(ticks.stamp, ticks.left + 1, ticks.right))


def chain(names: str, **hooks: Any) -> Graph:
    """Adders in a row, from key k0 to key kN."""
    return Graph(
        {name: Adder(NoParams()) for name in names},
        {name: {"ticks": f"k{i}"} for i, name in enumerate(names)},
        {name: {"more": f"k{i + 1}"} for i, name in enumerate(names)},
        **hooks,
    )


def test_sample_runs_through_the_chain_and_taps_see_cause_before_effect() -> None:
    graph = chain("abc")
    seen: list[tuple[str, int, int]] = []

    def listener(key: str) -> Callable[[WheelTicks], None]:
        return lambda message: seen.append((key, message.left, message.seq))

    for key in ("k3", "k1", "k2"):  # whatever the order of tapping
        graph.tap(key, listener(key))
    graph.deliver("k0", WheelTicks(1, 0, 0))
    graph.deliver("k0", WheelTicks(2, 100, 0))
    assert seen == [
        ("k1", 1, 0), ("k2", 2, 0), ("k3", 3, 0), ("k1", 101, 1), ("k2", 102, 1), ("k3", 103, 1),
    ]  # fmt: skip


def test_sample_is_handed_over_as_the_same_object() -> None:
    graph = chain("ab")
    sent: list[Message] = []
    got: list[Message] = []
    graph.tap("k1", sent.append)
    graph.nodes["a"].senders["more"].sinks.append(got.append)
    graph.deliver("k0", WheelTicks(1, 0, 0))
    assert sent[0] is got[0]


def test_two_taps_of_a_key_are_called_in_the_order_they_came() -> None:
    graph = chain("ab")
    calls: list[str] = []
    graph.tap("k1", lambda _: calls.append("first"))
    graph.tap("k1", lambda _: calls.append("second"))
    graph.tap("k2", lambda _: calls.append("after"))
    graph.deliver("k0", WheelTicks(1, 0, 0))
    assert calls == ["first", "second", "after"]


def test_exception_is_counted_and_the_chain_goes_on() -> None:
    faults: list[tuple[str, int, str]] = []
    graph = chain(
        "abc", on_error=lambda name, msg, error: faults.append((name, msg.left, str(error)))
    )
    out: list[int] = []
    graph.tap("k3", lambda message: out.append(message.left))
    for left in (0, 12, 13, 20):
        graph.deliver("k0", WheelTicks(left, left, 0))
    assert faults == [("b", 13, "no thirteen"), ("a", 13, "no thirteen")]
    assert out == [3, 23]
    for name in "ab":
        context = graph.nodes[name].context
        assert context.rejected["exception"] == 1
        assert context.last_error == "ValueError: no thirteen"
    assert graph.nodes["c"].context.rejected["exception"] == 0


def test_exit_in_a_handler_is_an_exception_like_others() -> None:
    faults: list[Exception] = []
    graph = chain("a", on_error=lambda _name, _msg, error: faults.append(error))
    graph.deliver("k0", WheelTicks(1, 17, 0))
    assert str(faults[0]) == "exit(2) in a handler: a node ends when its pipeline does"
    assert faults[0].__traceback__ is not None
    assert graph.nodes["a"].context.rejected["exception"] == 1


def test_failures_in_a_row_are_known_until_a_sample_goes_well() -> None:
    graph = chain("a")
    for _ in range(3):
        graph.deliver("k0", WheelTicks(1, 13, 0))
    assert graph.failing == {"a": 3}
    graph.deliver("k0", WheelTicks(2, 1, 0))
    assert graph.failing == {}


def test_what_a_tap_cannot_take_is_the_senders_error_not_that_of_the_node_before_it() -> None:
    graph = chain("ab")

    def refuse(_: Message) -> None:
        raise TypeError("cannot be packed")

    graph.tap("k2", refuse)
    graph.deliver("k0", WheelTicks(1, 0, 0))
    assert graph.nodes["b"].context.last_error == "TypeError: cannot be packed"
    assert graph.nodes["a"].context.last_error == ""


def test_keys_from_outside_and_keys_sent_are_told_apart() -> None:
    graph = chain("ab")
    assert set(graph.outside) == {"k0"}
    assert graph.sent == ("k1", "k2")
    out: list[Message] = []
    graph.tap("k2", out.append)
    graph.deliver("k1", WheelTicks(1, 0, 0))  # sent in here: a stranger's sample is ignored
    graph.deliver("nobody/reads/this", WheelTicks(1, 0, 0))
    assert out == []
    with pytest.raises(KeyError):
        graph.tap("k0", out.append)


def test_two_sources_of_a_key_are_refused() -> None:
    nodes = {"a": Adder(NoParams()), "b": Adder(NoParams())}
    with pytest.raises(ValueError, match="two sources of k1"):
        Graph(nodes, {}, {"a": {"more": "k1"}, "b": {"more": "k1"}})


def test_input_without_a_handler_is_refused() -> None:
    class Deaf(Node[NoParams]):
        ticks = Input(WheelTicks)

    with pytest.raises(TypeError, match=r"Deaf\.ticks has no handler"):
        Graph({"deaf": Deaf(NoParams())}, {"deaf": {"ticks": "k0"}}, {})


def test_nodes_are_closed_from_the_end_of_the_flow() -> None:
    closed: list[str] = []

    class Closing(Adder):
        def close(self) -> None:
            closed.append(self.context.name)

    Graph({name: Closing(NoParams(), Context(name)) for name in "abc"}, {}, {}).close()
    assert closed == ["c", "b", "a"]
