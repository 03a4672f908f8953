"""What several robots cost one laptop: bytes and processor time a robot, down-sampled or not.

Every robot is a machine of its own with a cable of its own to the laptop, which runs one
`lodeline up --host laptop` for each and listens to IMU (200 Hz) and odometry (100 Hz). They are
light robots, one node each, because one computer has to be them all: BUSY is how much of it was
in use, and near 100 % the figures beside it are those of a crowd. Needs root.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean
from typing import Annotated

from lodeline.bench import light_robot
from lodeline.bench.machines import Machine, Wire, missing
from lodeline.bench.pair import HOSTS, Ear, Side
from lodeline.supervisor.usage import Usage
from lodeline.tables import table
from lodeline.terminal.numbers import count, positive

EXIT_FAILED = 1
DOWN_SAMPLED = "link_rate: {imu/data_raw: 20}"


NODES = """
nodes:
  robot: {{run: {program}, outputs: {{data_raw: imu/data_raw, odom: odom}}}}
"""


@dataclass(frozen=True, slots=True)
class Cost:
    """What each of so many robots costs the laptop, on average over some seconds. `cpu` and `rss`
    are of the laptop's supervisor process for a robot, which holds its routers; `imu` and `odom`
    are the samples that came, of the robot of which fewest did; `busy` is a part of this computer.
    """

    robots: int
    bandwidth: Annotated[float, "B/s"]
    cpu: Annotated[float, "1"]
    rss: Annotated[float, "B"]
    imu: Annotated[float, "Hz"]
    odom: Annotated[float, "Hz"]
    busy: Annotated[float, "1"]


class Fleet:
    """`with Fleet(3) as fleet:` so many robots and a laptop, all up."""

    def __init__(self, robots: int, more: str = "") -> None:
        self._stack = ExitStack()
        try:
            self._set_up(robots, more)
        except BaseException:
            self._stack.close()
            raise

    def _set_up(self, robots: int, more: str) -> None:
        folder = Path(
            self._stack.enter_context(
                tempfile.TemporaryDirectory(prefix="ll", ignore_cleanup_errors=True)
            )
        )
        self.laptop = self._stack.enter_context(Machine())
        self.sides: dict[str, Side] = {}
        self.ears: dict[str, tuple[Ear, Ear]] = {}
        for number in range(1, robots + 1):
            name = f"robot{number}"
            machine = self._stack.enter_context(Machine())
            wire = Wire(machine, self.laptop, number)
            place = folder / name
            place.mkdir()
            file = place / "pipeline.yaml"
            program = Path(light_robot.__file__)
            address = wire.addresses[0]
            file.write_text(
                (HOSTS + NODES).format(name=name, address=address, program=program, more=more)
            )
            robot = Side(machine, file, "robot", place)
            self._stack.callback(robot.stop)
            self.sides[name] = side = Side(self.laptop, file, "laptop", place)
            self._stack.callback(side.stop)
            client = side.client()
            self._stack.callback(client.close)
            self.ears[name] = (
                Ear(client, f"{name}/imu/data_raw", "Imu"),
                Ear(client, f"{name}/odom", "Odometry"),
            )

    def wait(self, patience: float = 20.0) -> None:
        """Until something has come on every key. TimeoutError if it does not."""
        end = time.monotonic() + patience
        while any(not ear.samples for ears in self.ears.values() for ear in ears):
            if time.monotonic() > end:
                logs = "\n".join(side.log() for side in self.sides.values())
                raise TimeoutError(f"a robot is not heard:\n{logs}")
            time.sleep(0.05)

    def cost(self, seconds: float) -> Cost:
        """Measure for so long."""
        usages = {name: Usage() for name in self.sides}
        begin, bytes_before, idle_before = time.monotonic(), self._bytes(), _idle()
        for name, usage in usages.items():
            usage.sample(self.sides[name].process.pid, begin)
        time.sleep(seconds)
        end, bytes_after, idle_after = time.monotonic(), self._bytes(), _idle()
        elapsed = end - begin
        for name, usage in usages.items():
            usage.sample(self.sides[name].process.pid, end)
        imu, odom = (
            min(ears[place].between(begin, end).received for ears in self.ears.values()) / elapsed
            for place in (0, 1)
        )
        cables = [f"w{number}b" for number in range(1, len(self.sides) + 1)]
        return Cost(
            robots=len(self.sides),
            bandwidth=mean(bytes_after[each] - bytes_before[each] for each in cables) / elapsed,
            cpu=mean(usage.cpu for usage in usages.values()),
            rss=mean(usage.rss for usage in usages.values()),
            imu=imu,
            odom=odom,
            busy=1.0 - (idle_after - idle_before) / elapsed / (os.cpu_count() or 1),
        )

    def _bytes(self) -> dict[str, int]:
        """Bytes received and sent on each of the laptop's cables."""
        lines = self.laptop.run("cat", "/proc/net/dev").splitlines()[2:]
        fields = {line.split(":")[0].strip(): line.split(":")[1].split() for line in lines}
        return {name: int(values[0]) + int(values[8]) for name, values in fields.items()}

    def __enter__(self) -> Fleet:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def _idle() -> float:
    """Seconds for which the processors of this computer had nothing to do, all added up."""
    return float(Path("/proc/uptime").read_text(encoding="ascii").split()[1])


def main(argv: list[str]) -> int:
    """Run `lodeline bench fleet`; the exit code."""
    arguments = parser().parse_args(argv)
    if why := missing():
        print(f"no network namespaces here: {why}", file=sys.stderr)
        return EXIT_FAILED
    found: dict[str, list[Cost]] = {}
    for title, more in (("every sample", ""), (DOWN_SAMPLED, DOWN_SAMPLED)):
        for robots in arguments.robots:
            with Fleet(robots, more) as fleet:
                fleet.wait()
                found.setdefault(title, []).append(fleet.cost(arguments.seconds))
    if arguments.json:
        print(json.dumps({name: [asdict(cost) for cost in costs] for name, costs in found.items()}))
    else:
        print(_shown(found))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench fleet` takes."""
    parser = argparse.ArgumentParser(prog="lodeline bench fleet", description=__doc__)
    counts = [1, 4, 8]
    parser.add_argument("--robots", type=count, nargs="+", default=counts, metavar="N")
    parser.add_argument("--seconds", type=positive, default=8.0, help="how long (default: 8)")
    parser.add_argument("--json", action="store_true", help="JSON on standard output")
    return parser


def _shown(found: dict[str, list[Cost]]) -> str:
    cells = [
        (
            title,
            str(cost.robots),
            *(f"{cost.bandwidth / 1e3:.1f}", f"{cost.cpu:.1%}", f"{cost.rss / 2**20:.0f} MB"),
            *(f"{cost.imu:.0f}", f"{cost.odom:.0f}", f"{cost.busy:.0%}"),
        )
        for title, costs in found.items()
        for cost in costs
    ]
    headings = ("LINK", "ROBOTS", "KB/S EACH", "LAPTOP CPU", "RSS", "IMU HZ", "ODOM HZ", "BUSY")
    return table(headings, cells, right=headings[1:])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
