"""What the robot's sensors are exposed to, noise and faults of manufacture included.

Functions of the simulation's time [s] that chips sample: SI units, axes of the body (FLU) or, for
the IMU, of its board, which is mounted on it.
"""

from __future__ import annotations

from math import cos, hypot, pi, sin

from lodeline.rotation import matrix_from_euler
from lodeline.sim.noise import Noise
from lodeline.sim.params import RobotParams, Vector
from lodeline.sim.world import Motion, World

MICRO = 1e6  # noise is drawn per microsecond of the simulation


class Sensors:
    """Looks at a world with the eyes of its sensors."""

    def __init__(self, params: RobotParams, world: World) -> None:
        self._params = params
        self._world = world
        self._gyro_noise = Noise(params.seed, 1)
        self._accel_noise = Noise(params.seed, 2)
        self._mag_noise = Noise(params.seed, 3)
        self._encoder_noise = Noise(params.seed, 4)
        self._mounting = matrix_from_euler(*params.imu_mounting)

    def angular_velocity(self, t: float) -> Vector:
        """What the gyro senses [rad/s]."""
        rate = self._on_board(self._world.at(t).angular_velocity)
        p = self._params
        return _disturbed(rate, p.gyro_bias, p.gyro_noise, self._gyro_noise.triple(_index(t)))

    def specific_force(self, t: float) -> Vector:
        """What the accelerometer senses [m/s^2]: +9.81 on z at rest."""
        force = self._on_board(self._world.at(t).specific_force)
        p = self._params
        return _disturbed(force, p.accel_bias, p.accel_noise, self._accel_noise.triple(_index(t)))

    def magnetic_field(self, t: float) -> Vector:
        """What the magnetometer senses [T]."""
        p = self._params
        x, y, z = self._on_board(_into_body(self._world.at(t), _local_field(p)))
        m = p.soft_iron
        bent = (
            m[0] * x + m[1] * y + m[2] * z,
            m[3] * x + m[4] * y + m[5] * z,
            m[6] * x + m[7] * y + m[8] * z,
        )
        return _disturbed(bent, p.hard_iron, p.mag_noise, self._mag_noise.triple(_index(t)))

    def temperature(self, t: float) -> float:
        """What the thermometer senses [degC]: the chip warms up by 3 K after power-on."""
        return self._params.temperature + 3.0 * (1.0 - 1.0 / (1.0 + t / 60.0))

    def encoder_turns(self, t: float) -> tuple[float, float]:
        """What the encoders sense, left and right: parts of a turn in [0, 1)."""
        p, motion = self._params, self._world.at(t)
        left, right = self._encoder_noise.pair(_index(t))
        return (
            _turn(p.left_inverted, p.encoder_gear * motion.left_angle + p.encoder_noise * left),
            _turn(p.right_inverted, p.encoder_gear * motion.right_angle + p.encoder_noise * right),
        )

    def closed_reeds(self, t: float) -> int:
        """Which of the eight reeds a magnet closes: bit 0 is reed 1, the rightmost."""
        p = self._params
        motion = self._world.at(t)
        c, s = cos(motion.yaw), sin(motion.yaw)
        closed = 0
        for reed in range(1, 9):
            lateral = p.reed_pitch * (reed - 4.5)
            x = motion.x + p.bar_ahead * c - lateral * s
            y = motion.y + p.bar_ahead * s + lateral * c
            off = hypot(_off_grid(x, p.magnet_pitch), _off_grid(y, p.magnet_pitch))
            closed |= (off < p.reed_reach) << (reed - 1)
        return closed

    def _on_board(self, vector: Vector) -> Vector:
        """Turn a vector of the body into the axes of the IMU's board."""
        if self._params.imu_mounting == (0.0, 0.0, 0.0):
            return vector
        (a, b, c), (d, e, f), (g, h, i) = self._mounting
        x, y, z = vector
        return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def _index(t: float) -> int:
    return round(t * MICRO)


def _disturbed(true: Vector, bias: Vector, sd: float, noise: Vector) -> Vector:
    return (
        true[0] + bias[0] + sd * noise[0],
        true[1] + bias[1] + sd * noise[1],
        true[2] + bias[2] + sd * noise[2],
    )


def _local_field(p: RobotParams) -> Vector:
    """Return the earth's field [T] in ENU; declination is east of north, dip is downwards."""
    level = p.field_strength * cos(p.field_dip)
    return (
        level * sin(p.declination),
        level * cos(p.declination),
        -p.field_strength * sin(p.field_dip),
    )


def _into_body(motion: Motion, world: Vector) -> Vector:
    """Turn a vector of the world into the body's axes: the transpose of Rz Ry Rx."""
    sy, cy = sin(motion.yaw), cos(motion.yaw)
    sp, cp = sin(motion.pitch), cos(motion.pitch)
    sr, cr = sin(motion.roll), cos(motion.roll)
    x, y, z = cy * world[0] + sy * world[1], cy * world[1] - sy * world[0], world[2]
    x, z = cp * x - sp * z, sp * x + cp * z
    return x, cr * y + sr * z, cr * z - sr * y


def _off_grid(value: float, pitch: float) -> float:
    return value - pitch * round(value / pitch)


def _turn(inverted: bool, angle: float) -> float:
    """Return an angle [rad] as a part of a turn in [0, 1)."""
    return (-angle if inverted else angle) / (2.0 * pi) % 1.0
