"""Makes the recordings in tests/data/recordings: the simulated robot, in the formats of real ones.

    python -m tests.support.make_recordings

`rover.mcap` holds what the drivers of the default pipeline send, and the truth. `loop.txt` is the
same robot in the magnet lab's columns, at 20 Hz with 360 counts a turn; `loop_truth.csv` its pose.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from lodeline import virtual
from lodeline.pipeline.load import load
from lodeline.recording.write import RecordingWriter, whole_file
from lodeline_msgs import Message, Odometry, ReedBar, WheelTicks
from tests.support.live import ROOT

FOLDER = ROOT / "tests" / "data" / "recordings"
RAW = ("imu/data_raw", "imu/mag_raw", "wheels", "reeds", "truth")
ROVER_SECONDS, LOOP_SECONDS = 4.0, 45.0
SENSOR_COUNTS, LAB_COUNTS = 16384, 360


def samples(seconds: float, *settings: str) -> list[tuple[str, Message]]:
    """What the drivers of the default pipeline send in simulated time."""
    pipeline = load(ROOT / "pipeline.yaml", settings)
    found: list[tuple[str, Message]] = []

    def keep(key: str, message: Message) -> None:
        short = key.partition("/")[2]
        if short in RAW:
            found.append((short, message))

    with tempfile.TemporaryDirectory(prefix="ll") as folder:
        virtual.run(pipeline, seconds, Path(folder), keep)
    return found


def write_rover(file: Path) -> None:
    """The raw keys as MCAP."""
    with whole_file(file, replace=True) as stream:
        writer = RecordingWriter(stream, {"clock": "host", "source": "simulator"})
        for key, message in samples(ROVER_SECONDS):
            writer.write(key, message)
        writer.close()


def write_loop(file: Path, truth_file: Path) -> None:
    """Wheels and reeds as rows of the lab's text file, and the truth beside it."""
    rate = ("encoders.rate=20", "magnet_bar.rate=20", "simulator.rate=20")
    taken = samples(LOOP_SECONDS, *rate)
    start = taken[0][1].stamp
    reeds = {m.stamp: m for _, m in taken if isinstance(m, ReedBar)}
    wheels = [m for _, m in taken if isinstance(m, WheelTicks) and m.stamp in reeds]
    rows, truth = [], ["t_s,x_mm,y_mm,theta_rad"]
    for ticks in wheels:
        left, right = (count * LAB_COUNTS // SENSOR_COUNTS for count in (ticks.left, ticks.right))
        byte = 255 - reeds[ticks.stamp].closed
        numbers = (left, right, byte, 100.0 + (ticks.stamp - start) * 1e-9, *[0.0] * 11)
        rows.append("\t".join(f"{number:.6f}" for number in numbers))
    for key, message in taken:
        if key == "truth" and isinstance(message, Odometry):
            seconds = 100.0 + (message.stamp - start) * 1e-9
            truth.append(
                f"{seconds:.6f},{message.x * 1e3:.3f},{message.y * 1e3:.3f},{message.yaw:.6f}"
            )
    file.write_text("\n".join(rows) + "\n")
    truth_file.write_text("\n".join(truth) + "\n")


def main() -> int:
    FOLDER.mkdir(exist_ok=True)
    write_rover(FOLDER / "rover.mcap")
    write_loop(FOLDER / "loop.txt", FOLDER / "loop_truth.csv")
    for file in sorted(FOLDER.iterdir()):
        print(f"{file.name}: {file.stat().st_size} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
