"""The EKF in plain floats: no arrays, about twenty times as fast as one with them."""

from math import cos, pi, sin

from lodeline.ekf.belief import Belief, made
from lodeline.ekf.engine import Detection, Innovation, Noise, Row
from lodeline.ekf.motion import Delta
from lodeline.rotation import wrap_angle


class ScalarEngine:
    """`Engine` written out for three states and two measured values."""

    def predict(self, belief: Belief, delta: Delta, noise: Noise) -> Belief:
        """P <- A P A^T + B Q B^T + Q_alpha."""
        x, y, yaw, p00, p01, p02, p11, p12, p22 = belief
        ahead, left, turn = delta
        c, s = cos(yaw), sin(yaw)
        dx, dy = c * ahead - s * left, s * ahead + c * left
        # A = [[1, 0, -dy], [0, 1, dx], [0, 0, 1]]
        a02, a12 = p02 - dy * p22, p12 + dx * p22
        a00 = p00 - dy * (p02 + a02)
        a01 = p01 + dx * p02 - dy * a12
        a11 = p11 + dx * (p12 + a12)
        # B = [[c, -dy/2], [s, dx/2], [0, 1]], c and s half-way through the turn
        ss, st, tt, position, heading = noise
        course = yaw + 0.5 * turn
        c, s = cos(course), sin(course)
        bx, by = -0.5 * dy, 0.5 * dx
        cx, cy = c * ss + bx * st, s * ss + by * st  # (B Q), first column
        tx, ty = c * st + bx * tt, s * st + by * tt  # (B Q), second column
        yaw += turn
        return made(
            Belief,
            (
                x + dx,
                y + dy,
                yaw if -pi < yaw <= pi else wrap_angle(yaw),
                a00 + cx * c + tx * bx + position,
                a01 + cx * s + tx * by,
                a02 + tx,
                a11 + cy * s + ty * by + position,
                a12 + ty,
                p22 + tt + heading,
            ),
        )

    def weigh(self, belief: Belief, detection: Detection) -> Innovation:
        """y = Y - h(X), S = H P H^T + R and the squared Mahalanobis distance."""
        ahead, left, c, s = _expected(belief, detection)
        y0, y1 = detection.ahead - ahead, detection.left - left
        u0, u1, u2 = _times(belief, -c, -s, left)
        v0, v1, v2 = _times(belief, s, -c, -ahead)
        s00 = -c * u0 - s * u1 + left * u2 + detection.ahead_variance
        s01 = s * u0 - c * u1 - ahead * u2
        s11 = s * v0 - c * v1 - ahead * v2 + detection.left_variance
        # S = L D L^T: no determinant, whose subtraction loses digits when S is badly scaled
        ratio = s01 / s00
        rest = s11 - ratio * s01
        nis = y0 * y0 / s00 + (y1 - ratio * y0) ** 2 / max(rest, detection.left_variance)
        return Innovation(y0, y1, s00, s01, s11, nis)

    def correct(self, belief: Belief, detection: Detection) -> Belief:
        """K y and Joseph's form, one measured value after the other (R is diagonal)."""
        ahead, left, c, s = _expected(belief, detection)
        y0, y1 = detection.ahead - ahead, detection.left - left
        after = _joseph(belief, (-c, -s, left), y0, detection.ahead_variance)
        # linearised where the first was: less of the second innovation is left to explain
        turn = wrap_angle(after.yaw - belief.yaw)
        y1 -= s * (after.x - belief.x) - c * (after.y - belief.y) - ahead * turn
        return _joseph(after, (s, -c, -ahead), y1, detection.left_variance)

    def correct_scalar(self, belief: Belief, row: Row, residual: float, variance: float) -> Belief:
        """Joseph's form for one measured value."""
        return _joseph(belief, row, residual, variance)


def _expected(belief: Belief, detection: Detection) -> tuple[float, float, float, float]:
    """Where the magnet should be, h(X) = (ahead, left) [m], and cos, sin of the yaw.

    H = [[-cos, -sin, left], [sin, -cos, -ahead]].
    """
    c, s = cos(belief.yaw), sin(belief.yaw)
    dx, dy = detection.magnet_x - belief.x, detection.magnet_y - belief.y
    return c * dx + s * dy, c * dy - s * dx, c, s


def _times(belief: Belief, h0: float, h1: float, h2: float) -> tuple[float, float, float]:
    """P h^T."""
    _, _, _, p00, p01, p02, p11, p12, p22 = belief
    return (
        p00 * h0 + p01 * h1 + p02 * h2,
        p01 * h0 + p11 * h1 + p12 * h2,
        p02 * h0 + p12 * h1 + p22 * h2,
    )


def _joseph(belief: Belief, h: Row, y: float, r: float) -> Belief:
    """One measured value y = h dX + noise of variance r: P <- (I - k h) P (I - k h)^T + k r k^T."""
    h0, h1, h2 = h
    x, yy, yaw, p00, p01, p02, p11, p12, p22 = belief
    u0, u1, u2 = _times(belief, h0, h1, h2)
    variance = h0 * u0 + h1 * u1 + h2 * u2 + r
    k0, k1, k2 = u0 / variance, u1 / variance, u2 / variance
    # M = (I - k h) P = P - k u^T, then M (I - k h)^T = M - (M h^T) k^T
    m00, m01, m02 = p00 - k0 * u0, p01 - k0 * u1, p02 - k0 * u2
    m10, m11, m12 = p01 - k1 * u0, p11 - k1 * u1, p12 - k1 * u2
    m20, m21, m22 = p02 - k2 * u0, p12 - k2 * u1, p22 - k2 * u2
    # M h^T - r k, which is zero but for rounding
    g0 = m00 * h0 + m01 * h1 + m02 * h2 - r * k0
    g1 = m10 * h0 + m11 * h1 + m12 * h2 - r * k1
    g2 = m20 * h0 + m21 * h1 + m22 * h2 - r * k2
    return made(
        Belief,
        (
            x + k0 * y,
            yy + k1 * y,
            wrap_angle(yaw + k2 * y),
            m00 - g0 * k0,
            m01 - g0 * k1,
            m02 - g0 * k2,
            m11 - g1 * k1,
            m12 - g1 * k2,
            m22 - g2 * k2,
        ),
    )
