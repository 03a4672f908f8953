"""The hosts of a pipeline file and the addresses by which they reach each other."""

from __future__ import annotations

import ipaddress
import re

from lodeline.pipeline.document import Item
from lodeline.pipeline.model import Host
from lodeline.pipeline.shape import Shape

DEFAULT = "robot"
_ADDRESS = re.compile(r"((tcp|tls)/)?(\[[0-9a-fA-F:]+\]|[A-Za-z0-9.-]+)(:[0-9]{1,5})?")
_DOMAIN_NAME = re.compile(r"[A-Za-z0-9-]+(\.[A-Za-z0-9-]+)*")
_LOOPBACK = re.compile(r"(tcp/)?(127\.[0-9.]+|\[::1\]|localhost)(:[0-9]+)?")


def read_hosts(
    shape: Shape, item: Item | None, warnings: list[str], tls: bool = False
) -> dict[str, Host]:
    """Hosts by name; one without an address if the file names none. With `tls` no link is plain."""
    if item is None or item.value is None:
        return {DEFAULT: Host(DEFAULT)}
    members = shape.mapping(item, "hosts")
    if item.value == {}:
        shape.fault(item.place, "hosts names no host")
    alone = len(members) == 1
    hosts = {name: _host(shape, name, each, alone, warnings, tls) for name, each in members.items()}
    addressed = [host for host in hosts.values() if host.listen or host.connect]
    if len(addressed) > 1 and not any(host.listen for host in addressed):
        if len({host.connect for host in addressed}) > 1:
            shape.fault(item.key, "no host listens, so the hosts cannot reach each other")
        else:
            text = f"no host listens, so a zenoh router must, at {addressed[0].connect}"
            warnings.append(str(item.key.fault(text)))
    return hosts


def _host(shape: Shape, name: str, item: Item, alone: bool, warnings: list[str], tls: bool) -> Host:
    shape.name(name, item.key, "host")
    what = f"host {name!r}"
    ways = shape.mapping(item, what, ("listen", "connect", "scout", "grant"))
    listen = _address(shape, ways.get("listen"), "listen")
    connect = _address(shape, ways.get("connect"), "connect")
    scout = shape.value(ways.get("scout"), bool, "scout", False)
    if "listen" in ways and "connect" in ways:
        shape.fault(item.key, f"{what} can listen or connect, not both")
    elif not alone and not (ways.keys() & {"listen", "connect"} or scout):
        text = f"{what} has no address, write `listen: ...` or `connect: ...`"
        shape.fault(item.key, text)
    for way, address in (("listen", listen), ("connect", connect)):
        if tls and address and address.startswith("tcp/"):
            text = f"{way} is plain tcp, but the file has tls: leave out `tcp/`"
            shape.fault(ways[way].place, text)
    if listen and not tls and not listen.startswith("tls/") and not _LOOPBACK.fullmatch(listen):
        text = f"{what} listens on {listen} without tls: anyone on that network can read and send"
        warnings.append(str(ways["listen"].place.fault(text)))
    if scout:
        text = f"{what} scouts: it links with whoever answers its multicast"
        warnings.append(str(ways["scout"].place.fault(text)))
    grant = shape.value(ways.get("grant"), tuple[str, ...], "grant", ())
    return Host(name, listen, connect, scout, tuple(grant))


def _address(shape: Shape, item: Item | None, what: str) -> str | None:
    text: str | None = shape.value(item, str, what)
    if item is None or text is None:
        return None
    parts = _ADDRESS.fullmatch(text)
    if parts is None or (parts[4] and not 0 < int(parts[4][1:]) < 65536):
        shape.fault(item.place, f"{what} must be [tcp/|tls/]ADDRESS[:PORT], got {text!r}")
        return None
    if not is_address(parts[3]):
        text = f"{parts[3]!r} is neither an IP address nor the name of a machine"
        shape.fault(item.place, f"{what}: {text}")
        return None
    return text


def is_address(text: str) -> bool:
    """Whether it is an IP address (brackets allowed), or may be the name of a machine."""
    try:
        ipaddress.ip_address(text.strip("[]"))
    except ValueError:
        # No name ends in a number: that was meant to be an address.
        return bool(_DOMAIN_NAME.fullmatch(text)) and not text.rpartition(".")[2].isdigit()
    return True
