"""Claims about who joins late, and about machines whose files or programs differ."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

import lodeline_msgs
from lodeline.sessions import Client
from lodeline.watch import Watch
from lodeline_msgs import NodeStatus, WheelTicks, unpack
from tests.hosts.net import Host, Net, two_machines
from tests.support.live import eventually


@pytest.fixture(scope="module")
def joined() -> Iterator[tuple[Host, Host]]:
    """A robot that ran alone for a while, and the laptop that joined it."""
    with two_machines() as net:
        file = net.file()
        with Host(net.robot, file, "robot") as robot:
            assert eventually(lambda: robot.received("smoother", "wheels") > 50, 10.0, 0.2)
            with Host(net.laptop, file, "laptop") as laptop:
                assert eventually(lambda: laptop.linked("robot"), 10.0, 0.1)
                # Its own node has just begun: what it says first comes within a second or two.
                assert eventually(lambda: laptop.received("watcher", "speed") > 0, 10.0, 0.1)
                yield robot, laptop


def test_a_late_joiner_has_status_parameters_and_hash_at_once(joined: tuple[Host, Host]) -> None:
    _, laptop = joined
    began = time.monotonic()
    with Watch(laptop.running) as watch:
        statuses = watch.statuses(1.0)
        took = time.monotonic() - began
    assert set(statuses) == {"source", "smoother", "watcher"}
    assert took < 1.0
    assert statuses["source"].host == "robot"
    digests = {status.pipeline for status in statuses.values()}
    assert digests == {laptop.reports()["robot"]["digest"]}
    client = Client(laptop.folder)
    (answer,) = client.ask("rover/@share/robot/*")
    client.close()
    share = json.loads(answer[1])
    assert share["params"]["smoother"]["window"] == 0.1
    assert share["classes"]["rover/wheels"] == "WheelTicks"


def test_a_last_word_of_a_node_that_says_no_more_still_comes(joined: tuple[Host, Host]) -> None:
    """The kept status crosses the link: it does not wait for the next one."""
    _, laptop = joined
    came: list[NodeStatus] = []
    client = Client(laptop.folder)
    began = time.time_ns()
    client.subscribe_kept(
        "rover/status/source",
        lambda _key, data, _encoding: came.append(unpack(data, NodeStatus)),
    )
    assert eventually(lambda: len(came) >= 2, 5.0)
    client.close()
    assert came[0].stamp < began  # sent before anybody asked for it
    assert came[1].seq == came[0].seq + 1


def test_another_pipeline_on_the_other_side_is_named_on_both(net: Net) -> None:
    mine = net.file(at="one")
    other = net.file(at="two")
    other.write_text(other.read_text().replace("limit: 3", "limit: 4"))
    with Host(net.robot, mine, "robot") as robot, Host(net.laptop, other, "laptop") as laptop:
        assert eventually(lambda: robot.says("MISMATCH") and laptop.says("MISMATCH"), 10.0)
        hashes = {name: report["digest"] for name, report in laptop.reports().items()}
        assert hashes["robot"] != hashes["laptop"]
        seen = f"laptop runs pipeline {hashes['laptop']}, robot runs {hashes['robot']}"
        assert robot.links()["laptop"]["faults"] == [seen]
        assert "MISMATCH robot runs pipeline" in laptop.call("ps").stdout


def test_another_message_class_on_the_other_side_is_named(net: Net) -> None:
    mine = net.file(at="one")
    other = net.file(at="two")
    # There the watcher reads poses where the robot's smoother sends speeds.
    program = other.parent / "nodes" / "watcher.py"
    program.write_text(program.read_text().replace("Twist", "WheelTicks").replace(".v]", ".left]"))
    other.write_text(
        other.read_text()
        .replace("external: {cmd_vel: Twist}", "external: {cmd_vel: Twist, speed: WheelTicks}")
        .replace(", outputs: {speed: speed}", "")
    )
    with Host(net.robot, mine, "robot") as robot, Host(net.laptop, other, "laptop") as laptop:
        assert eventually(lambda: laptop.links()["robot"]["state"] == "linked", 10.0, 0.1)
        text = "rover/speed is WheelTicks on laptop, Twist on robot"
        assert eventually(lambda: text in robot.links()["laptop"]["faults"], 5.0, 0.1)
        assert eventually(lambda: laptop.says("MISMATCH rover/speed is Twist on robot"), 5.0)


def test_a_class_with_a_new_field_is_named_and_read_unless_old_samples_lack_it(
    net: Net, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The laptop has newer messages: a field that may be missing, and one that may not."""
    newer = tmp_path / "lodeline_msgs"
    shutil.copytree(Path(lodeline_msgs.__file__).parent, newer)
    for module, before, field in (
        ("control.py", "    w: Annotated", '    z: Annotated[float, Unit("m", "height")] = 0.0\n'),
        ("sensors.py", "    right: Annotated[int", '    rear: Annotated[int, Unit("tick")]\n'),
    ):
        text = (newer / module).read_text()
        head, found, tail = text.partition(before)
        line, end, rest = tail.partition("\n")
        assert found
        (newer / module).write_text(f"{head}{found}{line}{end}{field}{rest}")
    file = net.file()
    with Host(net.robot, file, "robot") as robot:
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        with Host(net.laptop, file, "laptop") as laptop:
            for name in ("Twist", "WheelTicks"):
                for host, other in ((robot, "laptop"), (laptop, "robot")):
                    named = f"MISMATCH {name} has other fields on {other} than on {host.name}"
                    assert eventually(lambda: host.says(named), 10.0), named  # noqa: B023
            assert eventually(lambda: laptop.received("watcher", "speed") > 50, 10.0, 0.2)
            record = ("bag", "record", "wheels", "-o", str(tmp_path / "none.mcap"))
            refused = laptop.call(*record, "--seconds", "1")
            assert "REFUSED wheels: " in refused.stderr and "rear" in refused.stderr


def test_a_sample_of_a_megabyte_crosses_the_link_and_a_larger_one_stops_nothing(
    joined: tuple[Host, Host],
) -> None:
    robot, laptop = joined
    sizes: list[int] = []
    wheels: list[tuple[float, int]] = []

    def take(_key: str, data: bytes, _encoding: str) -> None:
        wheels.append((time.monotonic(), unpack(data, WheelTicks).seq))

    with Watch(laptop.running) as there, Watch(robot.running) as here:
        there.subscribe("rover/cmd_vel", 64, lambda _key, data, _: sizes.append(len(data)))
        there.subscribe("rover/wheels", 4096, take)
        assert eventually(lambda: len(wheels) > 20, 5.0)
        publisher = here.publisher("rover/cmd_vel", "")
        assert eventually(lambda: publisher.watched, 5.0)

        def crosses(size: int) -> bool:
            publisher.put(bytes(size))
            return eventually(lambda: size in sizes, 1.0)

        for too_large, size in ((3_000_000, 200_000), (1_100_000, 1_000_000)):
            publisher.put(bytes(too_large))
            # The one right behind it finds the queue full, and may be dropped: the next is not.
            assert crosses(size) or crosses(size), size
        count = len(wheels)
        assert eventually(lambda: len(wheels) > count + 50, 5.0)
    assert set(sizes) == {200_000, 1_000_000}
    assert all(after == before + 1 for (_, before), (_, after) in pairwise(wheels))
    assert laptop.linked("robot")
