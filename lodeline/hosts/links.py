"""The link between the hosts of a pipeline, as its file gives it: endpoints of the hub."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # every node imports the bus, and the bus this
    from lodeline.pipeline.model import Pipeline

PORT = 7447
SEND_BUFFER = 8192
"""Bytes. A larger buffer holds seconds of old samples when the link is slow."""


class LinkError(RuntimeError):
    """The link cannot be opened as the file wants it."""


@dataclass(frozen=True, slots=True)
class Link:
    """What a hub opens besides its socket in the run folder: zenoh endpoints."""

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    scout: bool = False

    @property
    def ends(self) -> bool:
        """Whether it leads anywhere."""
        return bool(self.listen or self.connect or self.scout)

    @property
    def protocols(self) -> tuple[str, ...]:
        """Transports that the link needs."""
        ends = (*self.listen, *self.connect)
        return tuple(sorted({end.partition("/")[0] for end in ends})) or (
            ("tcp",) if self.scout else ()
        )


def link_of(pipeline: Pipeline, host: str) -> Link:
    """The link of one host to the others."""
    known = pipeline.hosts[host]
    return Link(
        listen=() if known.listen is None else (endpoint(known.listen),),
        connect=() if known.connect is None else (endpoint(known.connect),),
        scout=known.scout,
    )


def endpoint(address: str) -> str:
    """`10.0.0.1` of a pipeline file as `tcp/10.0.0.1:7447`."""
    protocol, slash, place = address.partition("/")
    if not slash:
        protocol, place = "tcp", address
    host, port = split(place)
    return f"{protocol}/{host}:{port}#so_sndbuf={SEND_BUFFER}"


def split(place: str) -> tuple[str, int]:
    """`ADDRESS[:PORT]`, an IPv6 address in brackets, as address and port."""
    host, colon, port = place.rpartition(":")
    if colon and not place.endswith("]"):
        return host, int(port)
    return place, PORT


def shown(ends: Sequence[str]) -> str:
    """Endpoints for people."""
    return ", ".join(end.partition("#")[0] for end in ends)


def check_listen(ends: Sequence[str]) -> None:
    """LinkError if another program has the address.

    zenoh keeps trying to listen, because an address may come later than the program; it would
    not say that one is taken.
    """
    for end in ends:
        host, port = split(end.partition("#")[0].partition("/")[2])
        family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host.strip("[]"), port))
            except OSError as error:
                if error.errno in (errno.EADDRINUSE, errno.EACCES):
                    why = os.strerror(error.errno)
                    raise LinkError(f"cannot listen on {shown([end])}: {why}") from None
