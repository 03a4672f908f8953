"""Parameters of the localiser."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from lodeline.ekf.engine import EngineName

NO_MAGNETS = 1e6  # m


@dataclass(frozen=True, slots=True)
class LocalizerParams:
    """Where it starts, what it sees, and how much it trusts what it sees.

    `process_noise: input` is P <- A P A^T + B Q B^T with the odometry's own covariance;
    `alpha` is the lab's other form, + Q_alpha = diag(a^2, a^2, b^2) per odometry step.
    `magnet_model: plain` takes every closed reed as a magnet under the bar, as the lab does;
    `edges` makes use of when a reed closes and opens (see `reeds`), `none` is for a floor without
    magnets. A magnet holds its reed closed over `passage`; the ends of it scatter by `edge_sigma`,
    the offset by `lateral_sigma`.
    `association: mixture` follows every magnet that may be meant, `nearest` takes the nearest, as
    the lab does. `gate` is on the squared Mahalanobis distance (9.21: 99 % of chi-square, 2
    degrees of freedom); after `widen_after` rejections among the last eight the doubt grows by
    `widen_sigma`. `reset_sigma` is the doubt that a gap in the odometry brings, also one it does
    not own up to (> `max_speed`), besides the way that it may have gone in it. While several
    magnets may be meant, the pose is ambiguous until a cell of the lattice has the probability
    `sure`.
    `wander` is how speed and rate of turn change while nobody looks, as random walks: it tells
    what a gap between two samples hides. `gyro_noise` is the random walk of the turn that a gyro
    measures, if one is connected; `track`
    is the distance of the wheels, by which a turn that only they see becomes a doubt about the
    way. `heading: on` takes the compass too: its error stays the same for long, so one reading is
    used per `heading_interval`, with `heading_sigma` more than it says of itself.
    `wheel_sigma`, above zero, lets it learn by how much wheels and track differ from what the
    odometry is told: how far way and turn may be off, as shares of themselves; `gyro_bias_sigma`
    likewise the bias of the gyro. Raises ValueError for a parameter that makes no sense.
    """

    engine: EngineName = "scalar"
    initial_pose: Annotated[tuple[float, float, float], "m, m, rad"] = (0.0, 0.0, 0.0)
    initial_sigma: Annotated[tuple[float, float], "m, rad"] = (0.005, 0.05)
    lattice_pitch: Annotated[float, "m"] = 0.055
    lattice_origin: Annotated[tuple[float, float], "m"] = (0.0, 0.0)
    bar_x: Annotated[float, "m"] = 0.080
    process_noise: Literal["input", "alpha"] = "input"
    alpha_sigma: Annotated[tuple[float, float], "m, rad"] = (0.002, 0.02)
    magnet_model: Literal["plain", "edges", "none"] = "edges"
    association: Literal["mixture", "nearest"] = "mixture"
    passage: Annotated[float, "m"] = 0.0165
    edge_sigma: Annotated[float, "m"] = 0.003
    lateral_sigma: Annotated[float, "m"] = 0.0035
    gate: Annotated[float, "1"] = 9.21
    widen_after: Annotated[int, "1"] = 4
    widen_sigma: Annotated[tuple[float, float], "m, rad"] = (0.030, 0.10)
    reset_sigma: Annotated[tuple[float, float], "m, rad"] = (0.015, 0.10)
    sure: Annotated[float, "1"] = 0.98
    wander: Annotated[tuple[float, float], "m/s^1.5, rad/s^1.5"] = (0.1, 1.0)
    gyro_noise: Annotated[float, "rad/s^0.5"] = 0.002
    wheel_sigma: Annotated[tuple[float, float], "1, 1"] = (0.0, 0.0)
    gyro_bias_sigma: Annotated[float, "rad/s"] = 0.0
    heading: Literal["off", "on"] = "off"
    heading_sigma: Annotated[float, "rad"] = 0.05
    heading_interval: Annotated[float, "s"] = 10.0
    track: Annotated[float, "m"] = 0.112
    max_speed: Annotated[float, "m/s"] = 5.0
    history: Annotated[float, "s"] = 1.0

    def __post_init__(self) -> None:
        positive = ("lattice_pitch", "passage", "edge_sigma", "lateral_sigma", "gate")
        for name in (*positive, "widen_after", "max_speed", "history", "heading_interval", "track"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        for name in ("initial_sigma", "alpha_sigma", "reset_sigma", "wander", "wheel_sigma"):
            if min(getattr(self, name)) < 0.0:
                raise ValueError(f"{name} must not be negative, as {getattr(self, name)} is")
        for name in ("gyro_noise", "heading_sigma", "gyro_bias_sigma"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must not be negative, as {getattr(self, name)} is")
        if max(*self.wheel_sigma, self.gyro_bias_sigma) > 0.3:
            raise ValueError("wheel_sigma and gyro_bias_sigma are at most 0.3: calibrate first")
        if not min(self.widen_sigma) > 0.0:
            # without it a robot that lost its way would reject every magnet for ever
            raise ValueError(f"widen_sigma must be positive, not {self.widen_sigma}")
        if not 0.5 <= self.sure < 1.0:
            raise ValueError(f"sure must be a probability of at least 0.5, not {self.sure}")
        if self.bar_error >= 0.5 * self.lattice_pitch:
            raise ValueError("passage and lateral_sigma must be small against lattice_pitch")

    @property
    def learns(self) -> bool:
        """True if constants of the robot are to be learned on the way."""
        return max(*self.wheel_sigma, self.gyro_bias_sigma) > 0.0

    @property
    def cell(self) -> float:
        """Pitch of the lattice [m]; without magnets they are so far apart that none matters."""
        return NO_MAGNETS if self.magnet_model == "none" else self.lattice_pitch

    @property
    def bar_error(self) -> float:
        """Standard deviation [m] of where a closed reed says that a magnet is."""
        return math.hypot(self.passage / math.sqrt(12.0), self.lateral_sigma)
