"""The localiser's parameters beside its samples: a recording says by what it was estimated."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Any

from lodeline.ekf import LocalizerParams
from lodeline.pipeline.model import Pipeline

METADATA = "localizer"
"""Key of the recording's metadata that holds them."""


def params_of(pipeline: Pipeline | None) -> LocalizerParams | None:
    """Those of the pipeline's localiser; None if it has none."""
    specs = () if pipeline is None else pipeline.nodes
    return next((each.params for each in specs if isinstance(each.params, LocalizerParams)), None)


def noted(pipeline: Pipeline | None) -> dict[str, str]:
    """What to add to a recording's metadata."""
    params = params_of(pipeline)
    return {} if params is None else {METADATA: json.dumps(asdict(params))}


def read(metadata: dict[str, str]) -> LocalizerParams | None:
    """The parameters that were noted; None if there are none that this version understands."""
    try:
        said = json.loads(metadata.get(METADATA, "null"))
        known = {each.name for each in fields(LocalizerParams)}
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in dict(said).items()
            if name in known
        }
        return LocalizerParams(**values)
    except (ValueError, TypeError):
        return None
