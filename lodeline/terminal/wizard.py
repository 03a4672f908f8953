"""A calibration with a robot that runs: what to do, how far it is, what became of it.

Progress is shown on the terminal and on the page; the readings come off the bus like any other's.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from math import inf
from typing import Any

from lodeline.calibration import CalibrationRefusedError, ImuCalibration
from lodeline.calibration.compass import CompassFit
from lodeline.calibration.coverage import SIDES, TURNS, Picture, picture, sides, turned
from lodeline.calibration.still import fit_accelerometer, resting_means
from lodeline.calibration.wheels import FEWEST_TURNS, REST, stopped
from lodeline.node import CalibrationInUse
from lodeline.recording.raw_readings import CLASSES, Readings
from lodeline.rotation import Vector
from lodeline.run_folder import Reader
from lodeline.terminal.circles import beside, ring, scatter
from lodeline.terminal.screen import Block
from lodeline.watch import CALIBRATING, Watch
from lodeline_msgs import DecodeError, WheelTicks, unpack

SECONDS = {"gyro": 5.0, "accel": 120.0, "mag": 120.0, "wheels": 120.0}
"""How long the robot is given; the gyro needs all of it."""
SHOW_EVERY_S = 0.4
QUEUE = 64
Fit = Callable[[list[Vector]], CompassFit]
ASKED = {
    "gyro": "keep the robot still",
    "accel": "lay the sensor on each of its six sides, a second or more each",
    "mag": "turn the robot on the spot, twice, slowly",
    "wheels": "drive as you said, then stop",
}


@dataclass(frozen=True, slots=True)
class Progress:
    """`parts` are what is done of each sector, side or wheel, 0 to 1, or of all."""

    parts: tuple[float, ...]
    text: str
    enough: bool = False
    passes: tuple[int, ...] = ()
    names: tuple[str, ...] = ()
    hint: str = ""


class Wizard:
    """Gathers readings of one kind from a running pipeline, and hands it what came of them.

    `ticks` are counts while a wheel turns once; without, the running odometry is asked for them.
    """

    def __init__(
        self, watch: Watch, kind: str, seconds: float | None, ticks: float | None, fit: Fit
    ) -> None:
        self.kind = kind
        self.seconds = seconds or SECONDS[kind]
        self._fit = fit
        self._watch = watch
        self._cls, ending = CLASSES[kind]
        self._key = watch.full_key(ending)
        for why in self._refusals().values():
            print(f"warning: {why}", file=sys.stderr)
        self._page = watch.publisher(f"{watch.manifest.name}/{CALIBRATING}", "application/json")
        self._block = Block()
        self._shown = -inf
        self.ticks = (ticks or self._ticks_in_use()) if kind == "wheels" else 1.0

    def gather(self) -> Readings:
        """Readings until they suffice or time is up; CalibrationRefusedError if none came."""
        if self.kind == "wheels":
            self._wait_for_rest()
        readings = Readings()
        print(f"{ASKED[self.kind]} ({self.seconds:.0f} s at most)", file=sys.stderr, flush=True)

        def take(data: bytes, _encoding: str) -> bool:
            readings.take(unpack(data, self._cls))
            over = readings.seconds >= self.seconds
            if readings.seconds - self._shown < SHOW_EVERY_S and not over:
                return True
            self._shown = readings.seconds
            progress = self._progress(readings)
            self._show(progress)
            return not (over or progress.enough)

        for key in self._wheels_beside():
            self._watch.subscribe(key, QUEUE, lambda _key, data, _: _beside(readings, data))
        self._watch.follow(self._key, take, self.seconds + 2.0)
        if not readings.times:
            raise CalibrationRefusedError(f"nothing came on {self._key}")
        return readings

    def _wheels_beside(self) -> list[str]:
        """The key that tells whether a robot drives whose gyro is to be calibrated."""
        known = self._watch.keys().items()
        keys = [key for key, each in known if each.type == WheelTicks.__name__]
        return [self._watch.full_key(keys[0])] if self.kind == "gyro" and len(keys) == 1 else []

    def _wait_for_rest(self) -> None:
        """What the wheels still roll from before is no part of the drive that was measured."""
        before = Readings()

        def take(data: bytes, _encoding: str) -> bool:
            before.take(unpack(data, self._cls))
            return not stopped(before.times, before.counts, self.ticks, REST)

        if not self._watch.follow(self._key, take, self.seconds):
            raise CalibrationRefusedError(
                "the wheels never stood still: stop the robot first"
                if before.times
                else f"nothing came on {self._key}"
            )

    def _progress(self, readings: Readings) -> Progress:
        gone = readings.seconds
        if self.kind == "gyro":
            return Progress((min(1.0, gone / self.seconds),), f"{gone:.1f} of {self.seconds:.0f} s")
        if self.kind == "mag":
            return self._turns(readings)
        if self.kind == "accel":
            return _sides(readings)
        return self._wheels(readings)

    def _turns(self, readings: Readings) -> Progress:
        seen = turned(readings.fields)
        parts = tuple(min(1.0, count / TURNS) for count in seen.passes)
        text = f"{seen.turns:.1f} of {TURNS:.0f} turns"
        hint = ""
        if enough := seen.turns >= TURNS and min(seen.passes) > 0:
            try:
                self._fit(readings.fields)
            except CalibrationRefusedError as error:
                enough, hint = False, str(error)
        return Progress(parts, text, enough, passes=seen.passes, hint=hint)

    def _wheels(self, readings: Readings) -> Progress:
        (left, right), (left_end, right_end) = readings.counts[0], readings.counts[-1]
        turns = [abs(left_end - left) / self.ticks, abs(right_end - right) / self.ticks]
        enough = min(turns) >= FEWEST_TURNS and stopped(readings.times, readings.counts, self.ticks)
        return Progress(
            tuple(min(1.0, turn / FEWEST_TURNS) for turn in turns),
            f"turns of the wheels: left {turns[0]:.1f}, right {turns[1]:.1f}",
            enough,
            names=("left", "right"),
        )

    def _show(self, progress: Progress) -> None:
        shown = {"parts": progress.parts, "names": progress.names, "hint": progress.hint}
        self._say("running", text=progress.text, **shown)
        if progress.passes:
            self._block.show("\n".join([*ring(progress.passes, progress.text), progress.hint]))
        elif progress.names:
            done = [
                f"[{'x' if part >= 1.0 else ' '}] {name}"
                for name, part in zip(progress.names, progress.parts, strict=True)
            ]
            self._block.show("\n".join(["  ".join(done), progress.text]))
        else:
            self._block.show(progress.text)

    def _say(self, state: str, **more: Any) -> None:
        said = {"kind": self.kind, "todo": ASKED[self.kind], "state": state} | more
        self._page.put(json.dumps(said).encode())

    def refused(self, why: str) -> None:
        """Tell the page, too."""
        self._say("refused", text=why)

    def in_use(self) -> ImuCalibration:
        """What the running pipeline calibrates by; that which changes nothing if nobody tells."""
        names = [item.name for item in fields(ImuCalibration)]
        for answer in self.hand_over(b"").values():
            if isinstance(answer, CalibrationInUse) and set(names) <= set(answer.values):
                return ImuCalibration(**{name: answer.values[name] for name in names})
        return ImuCalibration()

    def _ticks_in_use(self) -> float:
        answers = self.hand_over(b"").values()
        known = [each.values for each in answers if not isinstance(each, str)]
        told = {each["ticks_per_turn"] * each["gear"] for each in known if "gear" in each}
        if len(told) != 1:
            raise CalibrationRefusedError(
                f"how many counts a turn? No one odometry reads {self._key}: --ticks-per-turn"
            )
        return float(told.pop())

    def hand_over(self, data: bytes) -> dict[str, CalibrationInUse | str]:
        """Have the nodes that read these readings go by a file that holds `data`.

        By node: what it went by before, or why it refused.
        """
        whys = self._refusals()
        return whys | {
            reader.node: said["refused"] if "refused" in said else CalibrationInUse(**said)
            for reader in self._readers()
            if reader.node not in whys
            for said in self._watch.ask("@calibrate", f"/{reader.node}", data).values()
        }

    def _refusals(self) -> dict[str, str]:
        """Nodes that read these readings and cannot be told from here, and why."""
        manifest = self._watch.manifest
        whys = {item.node: manifest.refusal("calibrate", item.node) for item in self._readers()}
        return {node: why for node, why in whys.items() if why}

    def _readers(self) -> tuple[Reader, ...]:
        return self._watch.manifest.readers.get(self._key, ())

    def show_fit(self, readings: Readings, fit: CompassFit, before: ImuCalibration) -> Picture:
        """The circle before and after, in the terminal."""
        drawn = picture(readings.fields, before, fit)
        reach = 1.1 * max(abs(v) for point in (*drawn.before, *drawn.after) for v in point)
        if self._block.seen:
            before_it = ["before".center(20), *scatter(drawn.before, reach)]
            after_it = ["after".center(20), *scatter(drawn.after, reach)]
            self._block.show(beside(before_it, after_it))
        return drawn

    def written(self, verdict: str, drawn: Picture | None) -> None:
        """Tell the page how it ended."""
        circles = None if drawn is None else asdict(drawn)
        self._say("written", text=verdict, circles=circles, words=drawn.words if drawn else "")


def _beside(readings: Readings, data: bytes) -> None:
    with suppress(DecodeError):  # the nodes count and tell what they cannot read
        readings.beside(unpack(data, WheelTicks))


def _sides(readings: Readings) -> Progress:
    done: tuple[bool, ...] = (False,) * len(SIDES)
    try:
        means = resting_means(readings.forces, readings.rates, readings.rate)
        done = sides(means)
        fit_accelerometer(means)
        return Progress((1.0,) * len(SIDES), "all sides seen", True, names=SIDES)
    except CalibrationRefusedError as error:
        return Progress(tuple(map(float, done)), str(error), names=SIDES)
