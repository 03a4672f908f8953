"""Who takes part in the bus: a peer for each node, a hub and a gateway for each host, clients.

On one host every process is a peer on a unix socket of its own in the run folder; the hub, a
session in mode `router`, tells them of each other, and then data go straight from peer to peer.
Multicast scouting is off everywhere: with it on, a robot takes samples from strangers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.bus import Session

if TYPE_CHECKING:  # links drag much in that no node needs
    from lodeline.hosts.links import Link

HUB_SOCKET = "hub.sock"
LINK_BATCH = 2048
"""Bytes of a batch on the link between hosts; two of them wait, then samples are dropped."""


class Peer(Session):
    """The session of a node process."""

    def __init__(self, run_folder: Path, name: str) -> None:
        super().__init__(
            {
                "mode": "peer",
                "listen/endpoints": [_unix(run_folder / f"{name}.sock")],
                "connect/endpoints": [_unix(run_folder / HUB_SOCKET)],
                "connect/timeout_ms": 0,
                "connect/exit_on_failure": False,
            }
        )


class Hub(Session):
    """The session of a host's supervisor: introduces peers, lets tools in."""

    def __init__(self, run_folder: Path) -> None:
        super().__init__(
            {
                "mode": "router",
                "listen/endpoints": [_unix(run_folder / HUB_SOCKET)],
                "scouting/gossip/target": {"router": ["peer"], "peer": ["router", "peer"]},
            }
        )


class Gateway(Session):
    """The line from a host's hub to the other hosts; opens and closes as they come and go.

    Apart from the hub, because what suits a slow link starves a recorder beside the hub: batches
    are small, for samples grow old in large ones (at 256 kbit/s p99 4.7 s, here 0.4 s).
    """

    def __init__(
        self,
        run_folder: Path,
        link: Link,
        look: Callable[[str, float, bool, int], None] = lambda *_: None,
    ) -> None:
        """`look` is told what waits on the link, see `hosts.patience`."""
        from lodeline.hosts.patience import Impatience

        self._impatience = Impatience(look)
        self._impatience.start()
        try:
            super().__init__(
                {
                    "mode": "router",
                    "listen/endpoints": list(link.listen),
                    "listen/timeout_ms": {"router": -1},  # in the background: the address may come
                    "listen/exit_on_failure": {"router": False},
                    "connect/endpoints": [_unix(run_folder / HUB_SOCKET), *link.connect],
                    "connect/timeout_ms": -1,  # in the background: open does not wait for it
                    "connect/exit_on_failure": False,
                    "scouting/multicast/enabled": link.scout,
                    # Who listens answers, and dials nobody.
                    "scouting/multicast/autoconnect": {"router": [] if link.listen else ["router"]},
                    "scouting/gossip/enabled": False,
                    "transport/link/protocols": ["unixsock-stream", *link.protocols],
                    "transport/link/tx/batch_size": LINK_BATCH,
                    # A slow link fills its batches with samples that are alike: a third more cross.
                    "transport/unicast/compression/enabled": True,
                    # Room for what is said of keys and readers when a link comes up.
                    "transport/link/tx/queue/size/control": 16,
                    **link.settings,
                }
            )
        except BaseException:
            self._impatience.close()
            raise

    def close(self, timeout: float = 1.0) -> None:
        self._impatience.close()
        super().close(timeout)


class Client(Session):
    """The session of a tool: sees all through the hub, and is nobody's neighbour."""

    def __init__(self, run_folder: Path) -> None:
        super().__init__(
            {
                "mode": "client",
                "connect/endpoints": [_unix(run_folder / HUB_SOCKET)],
                "connect/timeout_ms": 2000,
            }
        )


def query(run_folder: Path, key: str, timeout: float = 1.0) -> list[tuple[str, bytes]]:
    """Answers to one query through a host's hub; BusError if nobody is there."""
    client = Client(run_folder)
    try:
        return client.ask(key, timeout)
    finally:
        client.close()


def _unix(path: Path) -> str:
    return f"unixsock-stream/{path}"
