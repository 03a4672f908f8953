"""Six errors and their covariance: three of a rotation, three of a gyro bias, in plain floats."""

from collections.abc import Sequence
from math import sqrt

from lodeline.attitude.doubt import NO_IDEA
from lodeline.rotation import Matrix

Six = tuple[float, float, float, float, float, float]
Covariance = tuple[Six, Six, Six, Six, Six, Six]
NOTHING: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CERTAIN: Covariance = (NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING)

Row = Sequence[tuple[int, float]]
"""A measurement of errors: its factors by number of the error, zeros left out."""


def diagonal(tilt: float, heading: float, bias: float) -> Covariance:
    """Independent errors with these variances [rad^2, rad^2, (rad/s)^2]."""
    variances = (tilt, tilt, heading, bias, bias, bias)
    return symmetric([[v if i == j else 0.0 for j in range(6)] for i, v in enumerate(variances)])


def predicted(c: Covariance, dt: float, r: Matrix, noise: float, walk: float) -> Covariance:
    """F P F' + Q with F = [[I, -R dt], [0, I]] and Q = diag(noise, walk), three of each."""
    rows = [list(row) for row in c]
    for i in range(3):  # F P: rows of the rotation take up rows of the bias
        a, b, g = r[i][0] * dt, r[i][1] * dt, r[i][2] * dt
        rows[i] = [
            v - a * x - b * y - g * z for v, x, y, z in zip(c[i], c[3], c[4], c[5], strict=True)
        ]
    for i, row in enumerate(rows):  # (F P) F': columns likewise
        x, y, z = row[3], row[4], row[5]
        for j in range(3):
            row[j] -= dt * (r[j][0] * x + r[j][1] * y + r[j][2] * z)
        row[i] += noise if i < 3 else walk
    return symmetric(rows)


def widened(c: Covariance, i: int, variance: float) -> Covariance:
    """The same with more doubt about error number `i`."""
    rows = [list(row) for row in c]
    rows[i][i] += variance
    return symmetric(rows)


def corrected(
    c: Covariance, row: Row, variance: float, held: Sequence[int] = ()
) -> tuple[Covariance, list[float]]:
    """(covariance, gains) after one scalar measurement with noise of `variance`.

    Errors numbered in `held` are not corrected. With a gain other than the optimal one the
    covariance needs its long form, P - K (P h)' - (P h) K' + K S K'.
    """
    ph = [0.0] * 6
    for i, factor in row:
        ph = [p + factor * v for p, v in zip(ph, c[i], strict=True)]
    total = variance
    for i, factor in row:
        total += factor * ph[i]
    gain = [v / total for v in ph]
    for i in held:
        gain[i] = 0.0
    rows = [
        [v - k * pj - pi * kj + k * total * kj for v, pj, kj in zip(line, ph, gain, strict=True)]
        for line, k, pi in zip(c, gain, ph, strict=True)
    ]
    return symmetric(rows), gain


def symmetric(rows: list[list[float]]) -> Covariance:
    """Equal halves, and no angle less known than not at all (shrunk with its correlations)."""
    for i in range(3):
        if rows[i][i] > NO_IDEA:
            k = sqrt(NO_IDEA / rows[i][i])
            for j in range(6):
                rows[i][j] *= k
                rows[j][i] *= k
    for i in range(6):
        for j in range(i):
            rows[i][j] = rows[j][i] = 0.5 * (rows[i][j] + rows[j][i])
    a, b, c, d, e, f = ((r[0], r[1], r[2], r[3], r[4], r[5]) for r in rows)
    return (a, b, c, d, e, f)
