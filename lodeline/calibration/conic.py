"""Robust fit of a centred quadric to points: the ellipse and the ellipsoid behind the compass fits.

Points q satisfy (q - c)' A (q - c) = 1. The algebraic least squares of that is linear in A and A c;
it is iterated with Tukey's weights on the distance from the surface, so that a spike counts for
nothing instead of for its square. Works in two dimensions and in three. Needs numpy, imported only
when used.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

from lodeline.calibration.quality import CalibrationRefusedError

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROUNDS = 30
TUKEY = 4.685  # scales of the residual beyond which a point counts for nothing
FAR = 4.0  # median distances from the median point, beyond which a point cannot start the fit


class Quadric(NamedTuple):
    """Centre (d,), symmetric matrix (d, d) that makes it a unit sphere, weights of points (n,)."""

    centre: "NDArray[Any]"
    shape: "NDArray[Any]"
    weights: "NDArray[Any]"


def fit_quadric(points: "NDArray[Any]") -> Quadric:
    """Fit to points (n, d), d = 2 or 3; refuses what lies on no closed surface."""
    import numpy as np

    middle = np.median(points, axis=0)
    distance = np.linalg.norm(points - middle, axis=1)
    size = float(np.median(distance))
    if size == 0.0:
        raise CalibrationRefusedError(
            "the readings do not change: is the sensor connected and turning?"
        )
    q = (points - middle) / size  # well conditioned whatever the unit
    weights = (distance <= FAR * size).astype(float)
    for _ in range(ROUNDS):
        centre, shape = _weighted(q, weights)
        residual = np.linalg.norm((q - centre) @ shape, axis=1) - 1.0
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-9)
        u = residual / (TUKEY * scale)
        updated = np.where(np.abs(u) < 1.0, (1.0 - u * u) ** 2, 0.0)
        settled = float(np.abs(updated - weights).max()) < 1e-6
        weights = updated
        if settled:
            break
    return Quadric(middle + size * centre, shape / size, weights)


def _weighted(q: "NDArray[Any]", weights: "NDArray[Any]") -> "tuple[NDArray[Any], NDArray[Any]]":
    """Centre and unit-sphere matrix by weighted algebraic least squares."""
    import numpy as np

    dimension = q.shape[1]
    pairs = [(i, j) for i in range(dimension) for j in range(i, dimension)]
    columns = [q[:, i] * q[:, j] * (1.0 if i == j else 2.0) for i, j in pairs]
    # Normalised by the trace instead of by the constant term, which vanishes through the origin:
    # sum a_ij q_i q_j + b q + k = 0 with trace a = dimension.
    columns += [q[:, i] for i in range(dimension)]
    columns.append(np.ones(len(q)))
    last = pairs.index((dimension - 1, dimension - 1))
    target = -dimension * columns[last]
    design = [
        column - (columns[last] if i == j else 0.0)
        for (i, j), column in zip(pairs, columns, strict=False)
        if (i, j) != pairs[last]
    ] + columns[len(pairs) :]
    root = np.sqrt(weights)
    matrix = np.stack(design, axis=1) * root[:, None]
    found, _, rank, _ = np.linalg.lstsq(matrix, target * root, rcond=1e-10)
    if rank < matrix.shape[1]:
        raise CalibrationRefusedError(
            "the readings cover too few directions to fit anything to them"
        )
    a = np.zeros((dimension, dimension))
    for (i, j), value in zip([p for p in pairs if p != pairs[last]], found, strict=False):
        a[i, j] = a[j, i] = value
    a[-1, -1] = dimension - np.trace(a)
    b, k = found[len(pairs) - 1 : -1], found[-1]
    if np.linalg.eigvalsh(a).min() <= 1e-3:
        raise CalibrationRefusedError(
            "the readings lie on no closed curve: turn further, and away from iron"
        )
    centre = -0.5 * np.linalg.solve(a, b)
    radius = centre @ a @ centre - k
    if radius <= 0.0:
        raise CalibrationRefusedError(
            "the readings lie on no closed curve: turn further, and away from iron"
        )
    values, vectors = np.linalg.eigh(a / radius)
    return centre, (vectors * np.sqrt(values)) @ vectors.T
