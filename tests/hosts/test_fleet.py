"""Claims about several robots on one laptop, and about what the link is asked to carry."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from lodeline.bench.machines import Machine, Wire, missing
from lodeline.run_folder import running
from lodeline.watch import Watch
from tests.hosts.net import Host, Net, hosts_at, write_file
from tests.support.live import eventually


@pytest.fixture
def folder() -> Iterator[Path]:
    if why := missing():
        pytest.skip(f"no network namespaces here: {why}")
    with TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True) as name:
        yield Path(name)


def test_three_robots_are_watched_side_by_side_from_one_laptop(folder: Path) -> None:
    with ExitStack() as stack:
        laptop = stack.enter_context(Machine())
        base = folder / "run"
        base.mkdir()
        names = ("ada", "bob", "cyd")
        for number, name in enumerate(names, 1):
            machine = stack.enter_context(Machine())
            address = Wire(machine, laptop, number).addresses[0]
            file = write_file(folder / name, hosts_at(address), name=name, watcher="laptop")
            stack.enter_context(Host(machine, file, "robot"))
            stack.enter_context(Host(laptop, file, "laptop", base=base))
        found = running(base=base)
        assert [item.manifest.name for item in found] == list(names)
        for item in found:
            with Watch(item) as watch:
                assert set(watch.ask("@ps")) == {"laptop", "robot"}
                assert eventually(lambda: received(watch, "watcher") > 50, 10.0, 0.2)


def received(watch: Watch, node: str) -> int:
    """Samples that a node took in."""
    status = watch.statuses(1.0).get(node)
    return sum(status.received.values()) if status else 0


def test_link_rate_thins_a_key_on_the_link_and_nowhere_else(net: Net) -> None:
    file = net.file(watcher="robot", more="link_rate: {wheels: 10}")
    with Host(net.robot, file, "robot") as robot, Host(net.laptop, file, "laptop") as laptop:
        assert eventually(lambda: laptop.linked("robot"), 10.0, 0.1)
        with ThreadPoolExecutor() as both:
            on_robot, on_laptop = both.map(
                lambda host: heard(host, "rover/wheels", 3.0), (robot, laptop)
            )
        assert 15 <= on_laptop <= 36
        assert on_robot > 200
        assert robot.received("smoother", "wheels") > 200


def heard(host: Host, key: str, seconds: float) -> int:
    """Samples of a key that a tool on a host gets in some seconds."""
    count = 0
    done = threading.Event()

    def take(_key: str, _data: bytes, _encoding: str) -> None:
        nonlocal count
        count += 1

    with Watch(host.running) as watch:
        watch.subscribe(key, 256, take)
        done.wait(seconds)
    return count
