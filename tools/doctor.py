"""Look at the robot's hardware, its links and its clocks, and say what is wrong and what helps.

`lodeline doctor bus` scans the I2C bus, `lodeline doctor imu` tries the IMU while the robot stands
still, and without a word it does both. Which bus and which devices are expected, the pipeline file
says; `bus: sim` is a simulated robot. A pipeline that runs meanwhile loses some samples of the IMU.

`lodeline doctor net` asks a pipeline that runs which of its hosts are linked, and looks for ports
of zenoh that this machine opens to strangers. `lodeline doctor clock` measures how far each host's
clock is ahead of this machine's, with an error bar.

Exit codes: 0 nothing failed, 1 something did, 2 usage, 3 invalid pipeline, 4 no pipeline runs.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from lodeline.terminal.numbers import positive

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lodeline.doctor.report import Check, Report
    from lodeline.i2c import Bus
    from lodeline.pipeline.model import Pipeline

FAILED, NOTHING = 1, 4
RUNNING = ("net", "clock")
"""Topics that concern a pipeline that runs, and no bus."""


def main(argv: list[str]) -> int:
    """Run `lodeline doctor`; the exit code."""
    from lodeline.doctor.report import Report

    arguments = _parsed(argv)
    report = Report(None if arguments.json else _show)
    if arguments.topic in RUNNING:
        return _running(report, arguments)
    return _hardware(report, arguments)


def _hardware(report: Report, arguments: argparse.Namespace) -> int:
    from lodeline.doctor.bus import check_bus, check_file, check_msgpack
    from lodeline.doctor.imu import Clock, check_imu
    from lodeline.doctor.wiring import wiring_of
    from lodeline.pipeline.load import find, load

    pipeline = load(find(arguments.pipeline))
    wiring = wiring_of(pipeline)
    where = arguments.bus if arguments.bus is not None else wiring.bus
    if where is None:
        report.add("bus", "FAIL", f"no driver of {pipeline.file} names a bus", "name it: --bus 1")
        return _end(report, arguments.json)
    bus = _opened(report, where, pipeline) if check_file(report, where) else None
    if bus is None:
        for topic in _topics(arguments.topic):
            report.add(topic, "skip", "the bus cannot be opened")
        return _end(report, arguments.json)
    for topic in _topics(arguments.topic):
        if topic == "bus":
            check_bus(report, bus, wiring.devices)
            check_msgpack(report)
        else:
            field = None if arguments.field is None else 1e-6 * arguments.field
            clock = Clock(time.monotonic, time.sleep)
            check_imu(report, bus, wiring.imu, wiring.compass, clock, field)
    bus.close()
    return _end(report, arguments.json)


def _running(report: Report, arguments: argparse.Namespace) -> int:
    from lodeline.doctor.clock import check_clocks
    from lodeline.doctor.net import check_links, check_ports, open_ports
    from lodeline.watch import NothingThereError, Watch, choose

    measured: dict[str, Any] = {}
    nothing = 0
    try:
        with Watch(choose(arguments.name)) as watch:
            if arguments.topic == "net":
                check_links(report, watch)
            else:
                measured = {"hosts": check_clocks(report, watch)}
    except NothingThereError as error:
        report.add("pipeline", "skip", str(error))
        nothing = NOTHING
    if arguments.topic == "net":
        check_ports(report, open_ports())
    return _end(report, arguments.json, measured) or nothing


def _parsed(argv: list[str]) -> argparse.Namespace:
    """The arguments, each of them of some use for its topic."""
    taking = parser()
    arguments = taking.parse_args(argv)
    hardware = (arguments.bus, arguments.pipeline, arguments.field)
    if arguments.topic in RUNNING and any(each is not None for each in hardware):
        taking.error(f"{arguments.topic} looks at a pipeline that runs: --name chooses it")
    if arguments.topic not in RUNNING and arguments.name is not None:
        taking.error("--name is for net and clock; a bus is found by --pipeline")
    return arguments


def parser() -> argparse.ArgumentParser:
    """What `lodeline doctor` takes."""
    parser = argparse.ArgumentParser(
        prog="lodeline doctor",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "topic", nargs="?", choices=["bus", "imu", *RUNNING], help="only these checks"
    )
    parser.add_argument("--bus", type=_bus, metavar="N", help="another I2C bus: 1, sim")
    parser.add_argument(
        "--pipeline",
        metavar="FILE",
        help="pipeline file or profile (default: ./pipeline.yaml, else the one that comes along)",
    )
    parser.add_argument("--field", type=positive, metavar="UT", help="the field expected here [uT]")
    parser.add_argument("--name", metavar="PIPELINE", help="net, clock: which, if several run")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _bus(text: str) -> int | str:
    return int(text) if text.isdigit() else text


def _topics(topic: str | None) -> tuple[str, ...]:
    return ("bus", "imu") if topic is None else (topic,)


def _opened(report: Report, where: int | str, pipeline: Pipeline) -> Bus | None:
    try:
        return _open(where, pipeline)
    except OSError as error:
        report.add("adapter", "FAIL", error.strerror or str(error), "name the bus: --bus 1")
        return None


def _open(where: int | str, pipeline: Pipeline) -> Bus:
    """A simulated one is that of the file's simulator, whose robot stands still."""
    from lodeline.i2c import Bus, open_model

    if where != "sim":
        return Bus(where)
    from lodeline.sim.params import RobotParams
    from lodeline.sim.robot import SimulatedRobot

    robots = (getattr(spec.params, "robot", None) for spec in pipeline.nodes)
    robot = next((each for each in robots if isinstance(each, RobotParams)), RobotParams())
    return open_model(SimulatedRobot(replace(robot, speed=0.0), time.monotonic).bus)


def _show(check: Check) -> None:
    print(check, flush=True)


def _end(report: Report, as_json: bool, measured: Mapping[str, Any] | None = None) -> int:
    if as_json:
        print(json.dumps({**report.plain(), **(measured or {})}, indent=2))
    else:
        verdicts = [check.verdict for check in report.checks]
        counts = ", ".join(
            f"{verdicts.count(each)} {each}" for each in ("ok", "warn", "FAIL", "skip")
        )
        print(f"{len(verdicts)} checks: {counts}", file=sys.stderr)
    return FAILED if report.failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
