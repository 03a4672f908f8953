"""Nodes of one process, wired by direct calls: a sample is handed over as the object it is.

Built from plain data, so that a live process and a replay over a recording use the same wiring.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lodeline.node import Node, Sender
from lodeline_msgs import Message

Handler = Callable[[Any], None]
OnError = Callable[[str, Message, Exception], None]
"""Name of the node, the sample that its handler could not take, what it raised."""


def _ignore(name: str, message: Message, error: Exception) -> None:
    """Whoever gives no hook is content with what the node's context counts."""


class Graph:
    """Nodes by name, in the order in which data flow, and the key of each of their ports.

    A sample goes at once to all who listen to its key: first the taps, then the neighbours in
    the order of `nodes` and of their ports. So a tap sees a sample before what follows from it.
    Raises ValueError for a key with two sources, TypeError for an input port without a handler.
    """

    def __init__(
        self,
        nodes: Mapping[str, Node[Any]],
        inputs: Mapping[str, Mapping[str, str]],
        outputs: Mapping[str, Mapping[str, str]],
        on_error: OnError = _ignore,
    ) -> None:
        self.nodes = dict(nodes)
        self.failing: dict[str, int] = {}  # exceptions in a row, by node
        self.ports: dict[tuple[str, str], Handler] = {}  # guarded handlers, by node and port
        self.outside: dict[str, list[Handler]] = {}  # readers of keys that no node here sends
        self._on_error = on_error
        self._senders: dict[str, Sender[Any]] = {}
        self._taps: dict[str, int] = {}
        for name, node in self.nodes.items():
            for port, key in outputs.get(name, {}).items():
                if key in self._senders:
                    raise ValueError(f"two sources of {key}")
                self._senders[key] = node.senders[port]
        for name, node in self.nodes.items():
            for port, key in inputs.get(name, {}).items():
                handler = self._guarded(name, node, port)
                self.ports[name, port] = handler
                if key in self._senders:
                    self._senders[key].sinks.append(handler)
                else:
                    self.outside.setdefault(key, []).append(handler)

    @property
    def sent(self) -> tuple[str, ...]:
        """Keys that the nodes here send, in the order in which data flow."""
        return tuple(self._senders)

    def deliver(self, key: str, message: Message) -> None:
        """Hand a sample from outside to every input that reads its key; others are ignored."""
        for handler in self.outside.get(key, ()):
            handler(message)

    def tap(self, key: str, listener: Handler) -> None:
        """Let `listener` have every sample sent on a key of `sent`; KeyError for another key.

        What it raises is an error of the sending node: it made what cannot be passed on.
        """
        sinks, place = self._senders[key].sinks, self._taps.get(key, 0)
        sinks.insert(place, listener)
        self._taps[key] = place + 1

    def close(self) -> None:
        """Close the nodes, the last in the data flow first."""
        for node in reversed(self.nodes.values()):
            node.close()

    def _guarded(self, name: str, node: Node[Any], port: str) -> Handler:
        """The handler of a port; its exception ends neither the chain nor the process."""
        method = type(node).inputs()[port].method
        if not method:
            raise TypeError(f"{type(node).__name__}.{port} has no handler")
        handler, failing, fail = getattr(node, method), self.failing, self._fail

        def take(message: Message) -> None:
            try:
                handler(message)
            except Exception as error:
                fail(name, node, message, error)
            except SystemExit as end:
                text = f"exit({end.code!r}) in a handler: a node ends when its pipeline does"
                fail(name, node, message, RuntimeError(text).with_traceback(end.__traceback__))
            else:
                if failing:
                    failing.pop(name, None)

        return take

    def _fail(self, name: str, node: Node[Any], message: Message, error: Exception) -> None:
        self.failing[name] = self.failing.get(name, 0) + 1
        node.context.reject("exception")
        node.context.last_error = f"{type(error).__name__}: {error}"
        self._on_error(name, message, error)
