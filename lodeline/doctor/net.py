"""Whether the hosts of a running pipeline reach each other, and whether strangers reach them."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from lodeline.doctor.report import Report
from lodeline.hosts.links import PORT
from lodeline.watch import Watch

SCOUTING_PORT = 7446
"""Where zenoh answers multicast."""
_LISTEN = "0A"


@dataclass(frozen=True, slots=True)
class Port:
    """An open port of this machine."""

    protocol: str
    address: str
    number: int

    @property
    def everywhere(self) -> bool:
        """Whether it is open on every address of the machine."""
        return self.address in ("0.0.0.0", "::")  # noqa: S104

    def __str__(self) -> str:
        return f"{self.protocol} {self.address}:{self.number}"


def check_links(report: Report, watch: Watch) -> None:
    """What each supervisor in reach says of the other hosts."""
    answers = watch.ask("@ps")
    for host in watch.manifest.host.split("+"):
        if not any(host in word.split("+") for word in answers):
            report.add(host, "FAIL", "its supervisor does not answer", "see `lodeline ps`")
    for word, answer in sorted(answers.items()):
        if refused := answer.get("refused"):
            text = f"refused: {refused['who']}: {refused['why']}"
            report.add(f"link of {word}", "FAIL", text, refused["remedy"])
        if slow := answer.get("slow"):
            who, takes, remedy = slow.removeprefix("LINK_SLOW ").split(": ", 2)
            report.add(f"link to {who}", "warn", takes, remedy)
        for link in answer["links"]:
            name = f"{word} to {link['host']}"
            if link["faults"]:
                report.add(name, "FAIL", "; ".join(link["faults"]), "start both from one file")
            elif link["state"] == "linked":
                report.add(name, "ok", f"linked for {link['seconds']:.0f} s")
            else:
                text = f"{link['state']} for {link['seconds']:.0f} s"
                fix = f"`lodeline up --host {link['host']}` there; is the cable in?"
                report.add(name, "warn", text, fix)


def check_ports(report: Report, ports: Iterable[Port]) -> None:
    """Ports of zenoh that anybody on any network can reach."""
    zenoh = [port for port in ports if port.number in (PORT, SCOUTING_PORT)]
    for port in zenoh:
        if port.protocol == "udp":
            text = f"{port} answers multicast: strangers can find this machine"
            report.add("ports", "warn", text, "leave `scout` out of the pipeline file")
        elif port.everywhere:
            text = f"OPEN_PORT {port} accepts zenoh on every network of this machine"
            report.add("ports", "FAIL", text, "listen on one address, or stop that program")
        else:
            report.add("ports", "ok", f"{port} is open on one address")
    if not zenoh:
        report.add("ports", "ok", "no port of zenoh is open")


def open_ports(folder: Path = Path("/proc/net")) -> list[Port]:
    """Listening TCP and all bound UDP ports, as the kernel lists them."""
    found: set[Port] = set()
    for name, mine in (("tcp", True), ("tcp6", True), ("udp", False), ("udp6", False)):
        try:
            lines = (folder / name).read_text().splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            _, local, _, state = line.split()[:4]
            if state == _LISTEN or not mine:
                address, _, port = local.rpartition(":")
                found.add(Port(name.rstrip("6"), _address(address), int(port, 16)))
    return sorted(found, key=str)


def _address(text: str) -> str:
    """An address of the kernel's list, which has 32 bit words in the machine's own order."""
    import socket

    words = bytes.fromhex(text)
    if sys.byteorder == "little":
        words = b"".join(words[i : i + 4][::-1] for i in range(0, len(words), 4))
    return socket.inet_ntop(socket.AF_INET if len(words) == 4 else socket.AF_INET6, words)
