"""Calibrate a sensor from a recording, a table, or the pipeline that runs now.

gyro: the sensor lies still for five seconds. accel: it lies still on each of its six sides, a
second or more each, in any order. mag: the robot turns on the spot, twice. wheels: a straight line
of --distance metres (their radius), or --turns on one spot, counter-clockwise (their track).

With a pipeline that runs, the terminal and the page show what is still missing, and the nodes that
read the sensor go by the result at once. A table (CSV) has the columns of `lodeline estimate`, or
t_s, left, right for wheels. The result is a section of a YAML file; `params: {file: ...}` of
nodes/calibrate.py makes it hold from then on. What is in the file already stays, the version before
is kept as FILE.prev. Exit codes: 0 written, 1 refused (the reason is told, the file is as it was),
2 usage, 4 no pipeline runs.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lodeline.calibration import CalibrationRefusedError, ImuCalibration
from lodeline.calibration.compass import (
    UNKNOWN,
    CompassFit,
    fit_ellipse,
    fit_ellipsoid,
    fit_minmax,
)
from lodeline.calibration.still import fit_accelerometer, gyro_zero, resting_means
from lodeline.calibration.wheels import WheelFit, fit_radius, fit_track
from lodeline.calibration_file import (
    CalibrationFileError,
    Section,
    calibrated,
    load,
    previous,
    store,
)
from lodeline.recording import NoRecordingError, RecordingError
from lodeline.recording.raw_readings import CLASSES, Readings, read
from lodeline.rotation import Vector
from lodeline.terminal.numbers import positive

if TYPE_CHECKING:
    from lodeline.node import CalibrationInUse

EXIT_FAILED, EXIT_NOTHING = 1, 4
OPTIONS = {
    "mag": ("method",),
    "wheels": ("distance", "turns", "ticks_per_turn", "wheel_radius"),
}
LIVE = ("seconds", "name")
MOST_READINGS = 20_000  # a fit of more gets no better, only slower


def main(argv: list[str]) -> int:
    """Run `lodeline calibrate`; the exit code."""
    args = parser().parse_args(argv)
    if why := _out_of_place(args):
        parser().error(why)
    if args.kind == "wheels" and (args.distance is None) == (args.turns is None):
        parser().error("wheels: either --distance or --turns")
    if args.kind == "wheels" and args.source and args.ticks_per_turn is None:
        parser().error("wheels from a file: how many counts a turn? --ticks-per-turn")
    from lodeline.watch import NothingThereError

    try:
        if args.source:
            section = calibration(args, read(args.source, args.kind), _on_file(args.output))
            print(_written(args, section, args.source.name))
            print(_use(args, section))
        else:
            _live(args)
    except (NothingThereError, NoRecordingError) as error:
        print(error, file=sys.stderr)
        return EXIT_NOTHING
    except CalibrationRefusedError as error:
        print(f"REFUSED {args.kind}: {error}", file=sys.stderr)
        return EXIT_FAILED
    except (RecordingError, CalibrationFileError, OSError) as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    return 0


def _out_of_place(args: argparse.Namespace) -> str:
    """What is asked that means nothing here, in words."""
    for kind, names in OPTIONS.items():
        for name in names:
            if kind != args.kind and getattr(args, name) is not None:
                return f"--{name.replace('_', '-')} is for {kind}, this is {args.kind}"
    for name in LIVE:
        if args.source and getattr(args, name) is not None:
            return f"--{name} is for a pipeline that runs, --from reads a file"
    return ""


def _on_file(file: Path) -> ImuCalibration:
    """What the file says already; that which changes nothing if it says nothing."""
    try:
        return calibrated(ImuCalibration(), str(file))[0]
    except CalibrationFileError:
        return ImuCalibration()


def _written(args: argparse.Namespace, section: Section, origin: str) -> str:
    """Write the section into the file; what there is to say of it."""
    stamped = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    kept = args.output.exists()
    store(args.output, args.kind, {"date": stamped, "chip": args.chip, "source": origin} | section)
    before = f", the version before is {previous(args.output)}" if kept else ""
    return f"{section['verdict']}\n{args.output}: {args.kind} written{before}"


def _live(args: argparse.Namespace) -> None:
    """Calibrate with the pipeline that runs, and let it go by what came of it."""
    from lodeline.terminal.wizard import Wizard
    from lodeline.watch import Watch, choose

    with Watch(choose(args.name)) as watch:
        fit = partial(fit_compass, args.method or "auto")
        wizard = Wizard(watch, args.kind, args.seconds, args.ticks_per_turn, fit)
        args.ticks_per_turn = wizard.ticks
        before = wizard.in_use()
        try:
            readings = wizard.gather()
            section = calibration(args, readings, before)
        except CalibrationRefusedError as error:
            wizard.refused(str(error))
            raise
        drawn = None
        if args.kind == "mag":
            drawn = wizard.show_fit(readings, fit(readings.fields, before), before)
        print(_written(args, section, "live"))
        if drawn:
            print(drawn.words)
        wizard.written(section["verdict"], drawn)
        answers = wizard.hand_over(args.output.read_bytes())
        print("\n".join(_taken(args, section, answers)))


def _taken(
    args: argparse.Namespace, section: Section, answers: dict[str, CalibrationInUse | str]
) -> list[str]:
    """Which nodes go by the new calibration already, and what makes the others do so."""
    lines = []
    lasting = False
    for node, answer in answers.items():
        if isinstance(answer, str):
            lines.append(f"{node} does not take it: {answer}")
        elif answer.file == str(args.output.resolve()):
            lines.append(f"{node} goes by it from now on")
            lasting = True
        else:
            lines.append(f"{node} goes by it now, until it is started again")
    return lines if lasting else [*lines, _use(args, section)]


def parser() -> argparse.ArgumentParser:
    """What `lodeline calibrate` takes."""
    parser = argparse.ArgumentParser(
        "lodeline calibrate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("kind", choices=list(CLASSES), help="what to calibrate")
    parser.add_argument(
        "--from",
        type=Path,
        dest="source",
        metavar="BAG|CSV",
        help="a recording or a table; without it, the pipeline that runs",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("calibration.yaml"),
        metavar="FILE",
        help="where to (default: calibration.yaml here)",
    )
    parser.add_argument("--chip", default="not told", help="which sensor it is, for the record")
    parser.add_argument(
        "--method",
        choices=["auto", "ellipse", "ellipsoid", "minmax"],
        help="mag: how to fit; auto (default) takes the ellipsoid if all sides were seen, else the"
        " ellipse",
    )
    parser.add_argument("--seconds", type=positive, metavar="S", help="live: give up after S")
    parser.add_argument("--name", metavar="PIPELINE", help="live: which one, if several run")
    parser.add_argument("--distance", type=positive, metavar="M", help="wheels: metres driven")
    parser.add_argument("--turns", type=positive, metavar="N", help="wheels: turns on one spot")
    parser.add_argument(
        "--ticks-per-turn",
        type=positive,
        metavar="N",
        help="wheels: counts while a wheel turns once, gear and all"
        " (live: what the running odometry goes by)",
    )
    parser.add_argument(
        "--wheel-radius",
        type=positive,
        metavar="M",
        help="wheels, for --turns: if it is not in the file",
    )
    return parser


def calibration(args: argparse.Namespace, readings: Readings, before: ImuCalibration) -> Section:
    """The section that comes out of the readings; CalibrationRefusedError with the reason."""
    if args.kind == "gyro":
        zero = gyro_zero(readings.rates, readings.rate, readings.forces, readings.counts)
        return {"residual": zero.error, "verdict": zero.verdict, "gyro_zero": zero.zero}
    if args.kind == "accel":
        rests = resting_means(readings.forces, readings.rates, readings.rate)
        fit = fit_accelerometer(rests)
        return {
            "residual": fit.misfit,
            "verdict": fit.verdict,
            "accel_offset": fit.offset,
            "accel_scale": fit.scale,
        }
    if args.kind == "mag":
        compass = fit_compass(args.method or "auto", readings.fields, before)
        return {
            "residual": compass.misfit,
            "verdict": compass.verdict,
            "mag_offset": compass.offset,
            "mag_matrix": compass.matrix,
        }
    return fit_wheels(args, readings)


def fit_compass(method: str, fields: list[Vector], before: ImuCalibration = UNKNOWN) -> CompassFit:
    """By the method named; `auto` by the one that the readings allow."""
    thinned = fields[:: 1 + len(fields) // MOST_READINGS]
    if method == "ellipsoid":
        return fit_ellipsoid(thinned)
    if method != "auto":
        return {"ellipse": fit_ellipse, "minmax": fit_minmax}[method](thinned, before)
    try:
        return fit_ellipsoid(thinned)
    except CalibrationRefusedError as error:
        whole = error
    try:
        return fit_ellipse(thinned, before)
    except CalibrationRefusedError as error:
        if str(error) == str(whole):
            raise
        raise CalibrationRefusedError(f"{error} (nor as turns about all axes: {whole})") from None


def fit_wheels(args: argparse.Namespace, readings: Readings) -> Section:
    """Radius or track; the section keeps the other one if the file has it."""
    try:
        known = load(args.output).sections.get("wheels", {})
    except CalibrationFileError:
        known = {}
    kept = {name: known[name] for name in ("wheel_radius", "track") if name in known}
    (left, right), (left_end, right_end) = readings.counts[0], readings.counts[-1]
    counts = (left_end - left, right_end - right)
    if args.distance is not None:
        fit = fit_radius(*counts, args.ticks_per_turn, args.distance)
        name = "wheel_radius"
    else:
        radius = args.wheel_radius or kept.get("wheel_radius")
        if radius is None:
            raise CalibrationRefusedError(
                "the radius of the wheels is not known: --wheel-radius, or --distance first"
            )
        fit = fit_track(*counts, args.ticks_per_turn, args.turns, radius)
        kept["wheel_radius"] = radius
        name = "track"
    return (
        {"residual": fit.difference, "verdict": _wheels_verdict(name, fit)}
        | kept
        | {
            name: fit.length,
            "left_sign": fit.left_sign,
            "right_sign": fit.right_sign,
        }
    )


def _wheels_verdict(name: str, fit: WheelFit) -> str:
    return f"{name} {fit.length:.5f} m, the wheels differ by {100.0 * fit.difference:.1f} %"


def _use(args: argparse.Namespace, section: Section) -> str:
    if args.kind == "wheels":
        names = ("wheel_radius", "track", "left_sign", "right_sign")
        values = ", ".join(f"{name}: {section[name]:.6g}" for name in names if name in section)
        return f"to use it, write into the params of nodes/odometry.py: {{{values}}}"
    return (
        f"to use it, write into the params of nodes/calibrate.py: {{file: {args.output.resolve()}}}"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
