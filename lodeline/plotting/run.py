"""A recording as plots see it: samples by what they are, over seconds since its beginning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from lodeline.ekf import LocalizerParams
from lodeline.keys import is_truth
from lodeline.plotting import NothingToPlotError
from lodeline.recording import localizer
from lodeline.recording.read import Recording
from lodeline.recording.table import read_tables
from lodeline_msgs import (
    AttitudeEstimate,
    MagnetDetection,
    Message,
    Odometry,
    PoseEstimate,
    ReedBar,
)

M = TypeVar("M", bound=Message)
NEEDED = (AttitudeEstimate, MagnetDetection, Odometry, PoseEstimate, ReedBar)


class Run:
    """What a recording, or a folder of tables, holds; each key in the order of its stamps.

    `params` are those of the localiser, `known` tells whether the recording has them in it.
    RecordingError for what cannot be read, NothingToPlotError for what has no estimate in it.
    """

    def __init__(self, path: Path, params: LocalizerParams | None = None) -> None:
        self.path = path
        noted = None
        self.source = "tables"
        if path.is_dir():
            self.samples = _sorted(read_tables(path))
            self.there = [f"{key} ({type(each[0]).__name__})" for key, each in self.samples.items()]
        else:
            with Recording(path) as recording:
                noted = localizer.read(recording.metadata)
                channels = recording.channels.values()
                keys = {each.key for each in channels if each.type in NEEDED}
                self.samples = _sorted((key, each) for key, each, _ in recording.samples(keys))
                self.there = [f"{each.key} ({each.type_name})" for each in channels]
                self.source = recording.metadata.get("source", "")
        self.known = params is not None or noted is not None
        self.params = params or noted or LocalizerParams()
        if not self.there:
            raise NothingToPlotError(
                f"{path} has not one sample in it: record anew while the pipeline sends some"
            )
        if not self.samples:
            there = ", ".join(self.there)
            raise NothingToPlotError(
                f"{path} has no estimate to plot, only {there}: let "
                f"`lodeline replay {path} --pipeline FILE -o OUT.mcap` make them"
            )
        self.start = min(samples[0].stamp for samples in self.samples.values())
        self.end = max(samples[-1].stamp for samples in self.samples.values())

    @property
    def name(self) -> str:
        """What people call it."""
        return self.path.stem

    def of(self, cls: type[M]) -> dict[str, list[M]]:
        """Samples of a class by key; those of the truth are left out."""
        return {
            key: [each for each in samples if isinstance(each, cls)]
            for key, samples in self.samples.items()
            if isinstance(samples[0], cls) and not is_truth(key)
        }

    def first(self, cls: type[M]) -> list[M]:
        """Samples of the first key of a class; NothingToPlotError if there is none."""
        found = self.of(cls)
        if not found:
            raise NothingToPlotError(f"no {cls.__name__} in it")
        return next(iter(found.values()))

    @property
    def truth(self) -> list[Odometry]:
        """What a simulator told of where the robot was; NothingToPlotError if nobody did."""
        for samples in self.truths.values():
            return samples
        raise NothingToPlotError("no truth in it")

    @property
    def truths(self) -> dict[str, list[Odometry]]:
        """The same by key; more than one if several robots were recorded."""
        return {
            key: [each for each in samples if isinstance(each, Odometry)]
            for key, samples in self.samples.items()
            if is_truth(key) and isinstance(samples[0], Odometry)
        }

    @property
    def estimate(self) -> tuple[str, Sequence[PoseEstimate | Odometry]]:
        """Key and samples of the best pose that there is."""
        for key, poses in self.poses.items():
            return key, poses
        raise NothingToPlotError("no PoseEstimate and no Odometry in it")

    @property
    def poses(self) -> dict[str, Sequence[PoseEstimate | Odometry]]:
        """Samples of all keys that have a pose, those of filters first; not the truth."""
        return {**self.of(PoseEstimate), **self.of(Odometry)}

    def times(self, samples: Iterable[Message]) -> list[float]:
        """Seconds since the beginning."""
        return [(each.stamp - self.start) * 1e-9 for each in samples]


def _sorted(samples: Iterable[tuple[str, Message]]) -> dict[str, list[Message]]:
    """By key and stamp. Of one stamp the last counts: it has all that came late in it."""
    found: dict[str, dict[int, Message]] = {}
    for key, message in samples:
        if isinstance(message, NEEDED):
            found.setdefault(key, {})[message.stamp] = message
    return {key: [each[stamp] for stamp in sorted(each)] for key, each in found.items()}
