"""One sample of every message; its packed form lies in tests/data/messages for ever."""

from pathlib import Path

from lodeline_msgs import (
    AttitudeEstimate,
    Imu,
    LandmarkDetection,
    MagnetDetection,
    MagneticField,
    Message,
    NodeStatus,
    Odometry,
    PoseEstimate,
    PositionFix,
    ReedBar,
    Twist,
    WheelTicks,
    pack,
)

FOLDER = Path(__file__).parents[1] / "data" / "messages"
STAMP = 1_700_000_000_123_456_789
COVARIANCE = (1e-4, 1e-6, 0.0, 1e-6, 4e-4, 2e-6, 0.0, 2e-6, 9e-4)

SAMPLES: tuple[Message, ...] = (
    Imu(STAMP, (0.01, -0.02, 1.5), (0.1, -0.2, 9.80665), seq=7),
    MagneticField(STAMP, (2.1e-5, -4.0e-6, -4.3e-5), seq=3),
    WheelTicks(STAMP, -120, 16384, seq=1),
    ReedBar(STAMP, 0b0001_1000, seq=2),
    MagnetDetection(STAMP, (-0.035, 0.03), seq=4),
    AttitudeEstimate(
        STAMP, (0.0, 0.0, 0.6, 0.8), (0.0, 0.1, -0.1), (1e-3, 0.0, -2e-3), 0.02, False, seq=5
    ),
    Odometry(
        STAMP, 1.5, -0.25, 3.0, 0.12, -0.5, COVARIANCE, (1e-4, 0.0, 0.0, 1e-3), 0.01, 2, seq=6
    ),
    PoseEstimate(STAMP, 0.055, 0.11, -1.57, COVARIANCE, 1.2, 3, True, seq=8),
    Twist(STAMP, 0.1, -0.2, seq=9),
    LandmarkDetection(STAMP, (1.5, -2.0), (0.5, 3.0), (1.25, 4.0), (0.05, 0.1), (), (), seq=11),
    PositionFix(STAMP, 0.75, -1.5, 0.1, seq=12),
    NodeStatus(
        stamp=STAMP,
        node="ekf",
        host="robot",
        state="running",
        pid=4711,
        pipeline="0123456789ab",
        rates={"rover/pose": 100.0},
        bandwidths={"rover/pose": 21000.0},
        age_p50={"rover/odom": 0.0004},
        age_p99={"rover/odom": 0.0021},
        received={"rover/odom": 1000},
        lost={"rover/odom": 1},
        late={"rover/odom": 0},
        rejected={"gate": 2},
        restarts=1,
        cpu=0.02,
        rss=28_000_000,
        last_error="",
        seq=10,
    ),
)


def name_of(message: Message) -> str:
    """Class name, as it stands in the file name of the golden sample."""
    return type(message).__name__


if __name__ == "__main__":
    for sample in SAMPLES:
        file = FOLDER / f"{name_of(sample)}.msgpack"
        if file.exists():
            print(f"kept {file.name}: a golden sample is never replaced")
        else:
            file.write_bytes(pack(sample))
            print(f"wrote {file.name}")
