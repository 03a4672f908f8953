"""The link between the hosts of a pipeline, as its file gives it: endpoints of the hub."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lodeline.hosts.permits import ORDERS, access_control, granted_orders

if TYPE_CHECKING:  # every node imports the bus, and the bus this
    from lodeline.pipeline.model import Pipeline

PORT = 7447
SEND_BUFFER = 8192
"""Bytes. A larger buffer holds seconds of old samples when the link is slow."""


class LinkError(RuntimeError):
    """The link cannot be opened as the file wants it."""


@dataclass(frozen=True, slots=True)
class Link:
    """What a gateway opens besides the hub's socket: zenoh endpoints, and settings for them.

    `withheld` is what it does not take from tools here to another host: `@restart`, `cmd_vel`.
    """

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    scout: bool = False
    settings: dict[str, Any] = field(default_factory=dict)
    withheld: tuple[str, ...] = ()

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
    protocol = "tcp" if pipeline.tls is None else "tls"
    listen = () if known.listen is None else (endpoint(known.listen, protocol),)
    connect = () if known.connect is None else (endpoint(known.connect, protocol),)
    settings: dict[str, Any] = {}
    if pipeline.link_rate:
        settings["downsampling"] = [_down_sampling(pipeline.link_rate)]
    withheld: list[str] = []
    if any(end.startswith("tls/") for end in (*listen, *connect)):
        settings |= _secured(pipeline, host)
        granted = granted_orders(pipeline, host)
        withheld = [f"@{order}" for order in ORDERS if order not in granted]
        keys = [key.removeprefix(f"{pipeline.name}/") for key in pipeline.external]
        withheld += [key for key in keys if key not in known.grant]
    return Link(listen, connect, known.scout, settings, tuple(withheld))


def keys_folder(pipeline: Pipeline) -> Path:
    """Where the hosts' keys are, if their link needs any."""
    return pipeline.tls or pipeline.file.parent / "keys"


def _secured(pipeline: Pipeline, host: str) -> dict[str, Any]:
    """Mutual TLS, and who may say what under it."""
    folder = keys_folder(pipeline)
    pair = {
        f"{way}_{what}": str(folder / f"{host}.{end}")
        for way in ("listen", "connect")
        for what, end in (("certificate", "pem"), ("private_key", "key"))
    }
    authority = {
        "root_ca_certificate": str(folder / "ca.pem"),
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }
    return {
        "transport/link/tls": authority | pair,
        "access_control": access_control(pipeline, host),
    }


def _down_sampling(rates: Mapping[str, float]) -> dict[str, Any]:
    return {
        "id": "link_rate",
        "flows": ["egress"],
        "link_protocols": ["tcp", "tls"],
        "messages": ["put"],
        "rules": [{"key_expr": key, "freq": rate} for key, rate in rates.items()],
    }


def endpoint(address: str, protocol: str = "tcp") -> str:
    """`10.0.0.1` of a pipeline file as `tcp/10.0.0.1:7447`."""
    given, slash, place = address.partition("/")
    if slash:
        protocol = given
    else:
        place = address
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
