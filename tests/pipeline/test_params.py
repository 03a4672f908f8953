"""Values against a dataclass of parameters: what is taken, and what is said of the rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import pytest

from lodeline.params import build, check_class, closest, nearest


@dataclass(frozen=True, slots=True)
class Inner:
    """A group."""

    gain: Annotated[float, "1/s"] = 1.0
    range: Literal[2, 4, 8] = 2

    def __post_init__(self) -> None:
        if self.gain < 0.0:
            raise ValueError("gain must not be negative")


@dataclass(frozen=True, slots=True)
class Outer:
    """One field of every kind."""

    pose: Annotated[tuple[float, float, float], "m, m, rad"]
    on: bool = False
    count: int = 1
    ratio: float = 0.5
    word: str = ""
    bus: int | str = "sim"
    limit: Annotated[float | None, "m"] = None
    names: tuple[str, ...] = ()
    inner: Inner = field(default_factory=Inner)

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"count must be at least 1, got {self.count}")
        if self.limit is not None and self.limit < self.ratio:
            raise ValueError("limit must not be below ratio")


def test_every_kind_of_value_is_taken() -> None:
    params, problems = build(
        Outer,
        {
            "pose": [0, 1, 2.5],
            "on": True,
            "count": 3,
            "ratio": 2,
            "word": "x",
            "bus": 1,
            "limit": 4,
            "names": ["a", "b"],
            "inner": {"gain": 2, "range": 8},
        },
    )
    assert problems == []
    inner = Inner(2.0, 8)
    assert params == Outer((0.0, 1.0, 2.5), True, 3, 2.0, "x", 1, 4.0, ("a", "b"), inner)
    assert params is not None and isinstance(params.ratio, float)


def test_a_made_group_is_taken_as_it_is() -> None:
    params, problems = build(Outer, {"pose": (0.0, 0.0, 0.0), "inner": Inner(3.0)})
    assert problems == [] and params is not None and params.inner == Inner(3.0)


@pytest.mark.parametrize(
    ("name", "value", "path", "text"),
    [
        ("on", 1, ("on",), "on must be true or false, got 1"),
        ("count", True, ("count",), "count must be a whole number, got true"),
        ("count", 2.0, ("count",), "count must be a whole number, got 2.0"),
        ("count", 0, ("count",), "count must be at least 1, got 0"),
        ("ratio", float("inf"), ("ratio",), "ratio must be a number, got inf"),
        ("ratio", None, ("ratio",), "ratio must be a number, got nothing"),
        ("word", 7, ("word",), "word must be a text, got 7"),
        ("bus", None, ("bus",), "bus must be a whole number or a text, got nothing"),
        ("limit", "far", ("limit",), 'limit must be a number [m], got the text "far"'),
        ("limit", 0.1, ("limit",), "limit must not be below ratio"),
        ("names", "a", ("names",), 'names must be a list, got the text "a"'),
        ("names", ["a", 1], ("names", 1), "names[1] must be a text, got 1"),
        ("pose", [0, 0], ("pose",), "pose must be a list of 3 [m, m, rad], got a list of 2"),
        ("pose", [0, 0, None], ("pose", 2), "pose[2] must be a number [rad], got nothing"),
        ("inner", 3, ("inner",), "inner must be a mapping of parameters, got 3"),
        ("inner", {"gain": -1}, ("inner", "gain"), "gain must not be negative"),
        ("inner", {"range": 3}, ("inner", "range"), "range must be one of 2, 4, 8, got 3"),
        ("inner", {"range": 2.0}, ("inner", "range"), "range must be one of 2, 4, 8, got 2.0"),
        ("inner", {"gian": 3}, ("inner", "gian"), "unknown parameter 'gian',"
         " did you mean 'gain'?"),
    ],
)  # fmt: skip
def test_wrong_value_is_named_with_the_path_to_it(
    name: str, value: Any, path: tuple[str | int, ...], text: str
) -> None:
    params, problems = build(Outer, {"pose": [0, 0, 0], name: value})
    assert params is None
    assert [(problem.path, problem.text) for problem in problems] == [(path, text)]


def test_all_problems_are_found_and_none_is_made_up() -> None:
    values = {"pose": [0, 0, 0], "cuont": 3, "ratio": "x", "count": 0, "limit": 0.1}
    texts = [problem.text for problem in build(Outer, values)[1]]
    # That limit is below ratio is not known while ratio is not.
    assert texts == [
        "unknown parameter 'cuont', did you mean 'count'?",
        'ratio must be a number, got the text "x"',
        "count must be at least 1, got 0",
    ]


def test_missing_parameter_is_named() -> None:
    assert [problem.text for problem in build(Outer, {})[1]] == ["parameter 'pose' is missing"]


def test_class_that_no_file_can_fill_is_refused() -> None:
    @dataclass
    class Deep:
        parts: tuple[list[int], ...] = ()

    check_class(Outer)
    with pytest.raises(TypeError, match=r"field 'parts' of Deep is of type list"):
        check_class(Deep)
    with pytest.raises(TypeError, match="int is no dataclass"):
        check_class(int)


def test_nearest_name_or_the_list_if_none_is_near() -> None:
    assert nearest("wheles", ["wheels", "odom"]) == ", did you mean 'wheels'?"
    assert nearest("zzz", ["wheels", "odom"]) == " (known: wheels, odom)"
    assert nearest("zzz", [str(i) for i in range(100)]) == ""
    assert closest("zzz", ["wheels"]) is None
