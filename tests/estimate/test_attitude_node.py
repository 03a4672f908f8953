"""Claims about the attitude node: every method of the library can be named in a pipeline file."""

from __future__ import annotations

from typing import Any

import pytest

from lodeline.attitude import METHODS, make_attitude
from lodeline.graph import Graph
from lodeline.loading import load_node, shipped
from lodeline.params import build
from lodeline.rotation import yaw_of
from lodeline_msgs import AttitudeEstimate, Imu, MagneticField, Message

NODE = load_node(shipped("nodes") / "attitude.py")
RATE, FORCE, FIELD = (0.01, -0.02, 0.3), (0.3, -0.2, 9.8), (5e-6, 18e-6, -40e-6)


def estimates(params: dict[str, Any]) -> list[AttitudeEstimate]:
    made, problems = build(NODE.params_type(), params)
    assert problems == []
    graph = Graph(
        {"attitude": NODE(made)},
        {"attitude": {"data": "data", "mag": "mag"}},
        {"attitude": {"attitude": "attitude"}},
    )
    out: list[Message] = []
    graph.tap("attitude", out.append)
    for i in range(200):
        graph.deliver("mag", MagneticField(10_000_000 * i, FIELD))
        graph.deliver("data", Imu(10_000_000 * i, RATE, FORCE))
    return [sample for sample in out if isinstance(sample, AttitudeEstimate)]


@pytest.mark.parametrize("method", METHODS)
def test_a_method_named_in_the_file_gives_what_the_library_gives(method: str) -> None:
    estimator = make_attitude(method)
    for i, estimate in enumerate(estimates({"method": method})):
        estimator.update(0.01 if i else 0.0, RATE, FORCE, FIELD)
        assert estimate.orientation == pytest.approx(estimator.orientation, abs=1e-9)
    assert estimate.gyro_bias == pytest.approx(estimator.gyro_bias, abs=1e-9)


def test_a_method_takes_the_parameters_under_its_name() -> None:
    here, there = (
        estimates({"method": "complementary", "complementary": {"declination": east}})[-1]
        for east in (0.0, 0.1)
    )
    assert yaw_of(here.orientation) - yaw_of(there.orientation) == pytest.approx(0.1, abs=1e-6)


def test_a_misspelt_method_is_refused_with_the_right_name() -> None:
    _, problems = build(NODE.params_type(), {"method": "tilt_compas"})
    assert "did you mean 'tilt_compass'?" in problems[0].text
