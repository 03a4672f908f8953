"""The EKF by filterpy (>= 2.0, whose Mahalanobis distance is right): the reference engine.

Importing this module costs seconds and tens of megabytes (numpy, scipy): only `make_engine` does.
"""

import math

import numpy as np
import numpy.typing as npt
from filterpy.kalman import ExtendedKalmanFilter

from lodeline.ekf.belief import Belief
from lodeline.ekf.engine import Detection, Innovation, Noise, Row
from lodeline.ekf.motion import Delta
from lodeline.rotation import wrap_angle

Array = npt.NDArray[np.float64]


class FilterpyEngine:
    """`Engine` on an ExtendedKalmanFilter that is loaded with the belief at each call."""

    def __init__(self) -> None:
        self._ekf = ExtendedKalmanFilter(dim_x=3, dim_z=2)
        self._single = ExtendedKalmanFilter(dim_x=3, dim_z=1)

    def predict(self, belief: Belief, delta: Delta, noise: Noise) -> Belief:
        """P <- A P A^T + B Q B^T + Q_alpha by filterpy; the mean moves by its own model."""
        c, s = math.cos(belief.yaw), math.sin(belief.yaw)
        dx, dy = c * delta.ahead - s * delta.left, s * delta.ahead + c * delta.left
        course = belief.yaw + 0.5 * delta.turn
        b = np.array([[math.cos(course), -0.5 * dy], [math.sin(course), 0.5 * dx], [0.0, 1.0]])
        q = np.array([[noise.ss, noise.st], [noise.st, noise.tt]])
        alpha = np.diag([noise.position, noise.position, noise.heading])
        ekf = self._load(belief)
        ekf.F = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        ekf.Q = b @ q @ b.T + alpha
        ekf.predict()
        ekf.x = np.array([belief.x + dx, belief.y + dy, belief.yaw + delta.turn])
        return _unload(ekf)

    def weigh(self, belief: Belief, detection: Detection) -> Innovation:
        """y, S and y^T S^-1 y of the detection, by solving for it."""
        h, expected = _jacobian(belief, detection), _expected(belief, detection)
        y = np.array([detection.ahead, detection.left]) - expected
        s = h @ self._load(belief).P @ h.T + _r(detection)
        nis = float(y @ np.linalg.solve(s, y))
        return Innovation(
            float(y[0]), float(y[1]), float(s[0, 0]), float(s[0, 1]), float(s[1, 1]), nis
        )

    def correct(self, belief: Belief, detection: Detection) -> Belief:
        """filterpy's update with the measurement function and its Jacobian."""
        self._load(belief).update(
            np.array([detection.ahead, detection.left]),
            HJacobian=lambda _: _jacobian(belief, detection),
            Hx=lambda _: _expected(belief, detection),
            R=_r(detection),
        )
        return _unload(self._ekf)

    def correct_scalar(self, belief: Belief, row: Row, residual: float, variance: float) -> Belief:
        """filterpy's update with one measured value."""
        ekf = _load(self._single, belief)
        ekf.update(
            np.array([residual]),
            HJacobian=lambda _: np.array([row]),
            Hx=lambda _: np.zeros(1),
            R=np.array([[variance]]),
        )
        return _unload(ekf)

    def _load(self, belief: Belief) -> ExtendedKalmanFilter:
        return _load(self._ekf, belief)


def _load(ekf: ExtendedKalmanFilter, belief: Belief) -> ExtendedKalmanFilter:
    ekf.x = np.array([belief.x, belief.y, belief.yaw])
    ekf.P = np.array(belief.covariance).reshape(3, 3)
    return ekf


def _unload(ekf: ExtendedKalmanFilter) -> Belief:
    x, y, yaw = (float(value) for value in ekf.x)
    p = [float(value) for value in ekf.P[np.triu_indices(3)]]
    return Belief(x, y, wrap_angle(yaw), *p)


def _expected(belief: Belief, detection: Detection) -> Array:
    c, s = math.cos(belief.yaw), math.sin(belief.yaw)
    dx, dy = detection.magnet_x - belief.x, detection.magnet_y - belief.y
    return np.array([c * dx + s * dy, c * dy - s * dx])


def _jacobian(belief: Belief, detection: Detection) -> Array:
    c, s = math.cos(belief.yaw), math.sin(belief.yaw)
    ahead, left = (float(value) for value in _expected(belief, detection))
    return np.array([[-c, -s, left], [s, -c, -ahead]])


def _r(detection: Detection) -> Array:
    return np.diag([detection.ahead_variance, detection.left_variance])
