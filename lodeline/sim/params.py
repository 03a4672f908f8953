"""All parameters of the simulated robot in one flat dataclass, as a pipeline file names them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]
ImuChip = Literal["mpu9250", "mpu9255", "mpu9150", "mpu6500", "mpu6050"]
BarChip = Literal["pcf8574", "mcp23017", "none"]
POSITIVE = (
    "encoder_gear",
    "wheel_radius",
    "track",
    "course_radius",
    "slip_time",
    "bump_width",
    "castor",
    "reed_pitch",
    "reed_reach",
    "magnet_pitch",
)


@dataclass(frozen=True, slots=True)
class RobotParams:
    """The robot (of the magnet lab), its floor and its sensors.

    It stands for `standing` before it drives off, as a robot that was just switched on does.
    What odometry cannot know: a wheel's true radius is `wheel_radius` (1 + its scale error), and
    its grip wanders about that by `slip`, with a memory of `slip_time`. `bump_height` is that of a
    strip `bump_width` wide across the floor at x = `bump_x`, over which the wheels and the castor
    behind them climb. Noise is a standard deviation per sample. The magnetometer reads `soft_iron`
    (3 x 3, row by row) times the local field, plus `hard_iron`. An inverted encoder counts down
    when its wheel rolls forward, and turns `encoder_gear` times while the wheel turns once.
    `imu_mounting` is roll, pitch and yaw of the IMU in the body, whose clock runs too fast by
    `imu_clock_error`. A sensor without any noise is to the drivers one that is stuck.
    """

    seed: Annotated[int, "1"] = 1
    wheel_radius: Annotated[float, "m"] = 0.0215
    track: Annotated[float, "m"] = 0.112
    standing: Annotated[float, "s"] = 2.0
    speed: Annotated[float, "m/s"] = 0.12
    course_straight: Annotated[float, "m"] = 0.35
    course_radius: Annotated[float, "m"] = 0.20
    left_scale_error: Annotated[float, "1"] = 0.0025
    right_scale_error: Annotated[float, "1"] = -0.001
    slip: Annotated[float, "1"] = 0.005
    slip_time: Annotated[float, "s"] = 0.3
    bump_x: Annotated[float, "m"] = 0.18
    bump_width: Annotated[float, "m"] = 0.03
    bump_height: Annotated[float, "m"] = 0.002
    castor: Annotated[float, "m"] = 0.06
    gyro_noise: Annotated[float, "rad/s"] = 0.0017
    gyro_bias: Annotated[tuple[float, float, float], "rad/s"] = (0.012, -0.008, 0.006)
    accel_noise: Annotated[float, "m/s^2"] = 0.03
    accel_bias: Annotated[tuple[float, float, float], "m/s^2"] = (0.0, 0.0, 0.0)
    mag_noise: Annotated[float, "T"] = 0.5e-6
    field_strength: Annotated[float, "T"] = 47.0e-6
    field_dip: Annotated[float, "rad"] = 1.10
    declination: Annotated[float, "rad"] = 0.0
    hard_iron: Annotated[tuple[float, float, float], "T"] = (11.5e-6, -1.0e-6, 6.0e-6)
    soft_iron: Annotated[Matrix, "1"] = (1.06, 0.02, 0.0, 0.02, 0.95, 0.01, 0.0, 0.01, 0.99)
    temperature: Annotated[float, "degC"] = 27.0
    encoder_noise: Annotated[float, "rad"] = 0.0005
    bar_ahead: Annotated[float, "m"] = 0.08
    reed_pitch: Annotated[float, "m"] = 0.01
    reed_reach: Annotated[float, "m"] = 0.00825
    magnet_pitch: Annotated[float, "m"] = 0.055
    left_inverted: Annotated[bool, "1"] = False
    right_inverted: Annotated[bool, "1"] = False
    encoder_gear: Annotated[float, "1"] = 1.0
    imu_chip: ImuChip = "mpu9250"
    imu_mounting: Annotated[tuple[float, float, float], "rad"] = (0.0, 0.0, 0.0)
    imu_clock_error: Annotated[float, "1"] = 0.003
    bar_chip: BarChip = "pcf8574"

    def __post_init__(self) -> None:
        for name in POSITIVE:
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        if self.course_straight < 0.0:
            raise ValueError(f"course_straight must not be negative, not {self.course_straight}")
