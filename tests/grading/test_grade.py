"""A student's node is held against the reference, and told what is wrong with it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lodeline import cli
from lodeline.grading import EXERCISES, GradingError, grade, mistakes, patience

Capture = pytest.CaptureFixture[str]
MISTAKES = [
    pytest.param(name, part.name, wrong, hint, id=f"{part.name}-{wrong.__name__}")
    for name, exercise in EXERCISES.items()
    for part in exercise.parts
    for wrong, hint in part.mistakes
]


def write(folder: Path, text: str) -> Path:
    file = folder / "mine.py"
    file.write_text(text)
    return file


@pytest.mark.parametrize("name", EXERCISES)
def test_a_blank_loads_and_runs_but_does_not_pass(name: str, tmp_path: Path) -> None:
    blank = EXERCISES[name].blank()
    assert "solution" not in blank
    found = grade(EXERCISES[name], write(tmp_path, blank), seeds=(1,))
    assert not found.passed
    assert found.raised == ""
    assert found.sent == found.wanted > 1000


@pytest.mark.parametrize("name", EXERCISES)
def test_the_solution_passes(name: str, tmp_path: Path) -> None:
    solved = EXERCISES[name].file.read_text()
    found = grade(EXERCISES[name], write(tmp_path, solved), seeds=(1, 3))
    assert found.passed
    assert [difference.worst for difference in found.differences] == pytest.approx(
        [0.0] * len(found.differences), abs=1e-12
    )


def replaced(name: str, code: str) -> str:
    """The solution, with something after its functions that takes the place of some."""
    text = EXERCISES[name].file.read_text()
    place = text.index("@dataclass")
    return f"{text[:place]}{code}\n\n{text[place:]}"


@pytest.mark.parametrize(("name", "function", "wrong", "hint"), MISTAKES)
def test_a_known_mistake_is_told_apart_from_all_others(
    name: str, function: str, wrong: Callable[..., object], hint: str, tmp_path: Path
) -> None:
    code = f"from lodeline.grading import mistakes\n{function} = mistakes.{wrong.__name__}"
    found = grade(EXERCISES[name], write(tmp_path, replaced(name, code)), seeds=(1,))
    assert not found.passed
    assert found.hint == hint


@pytest.mark.parametrize(
    ("name", "code", "hint"),
    [
        ("odometry", "def travel(*_): 0.0, 0.0, 0.0", "travel gives None: is its `return` missing"),
        ("odometry", "def travel(*_): return 1.0, 2.0", "travel gives 2 numbers, 3 are"),
        ("heading", "def heading(*_): return 'north'", "heading gives a str, one number is"),
        (
            "measurement",
            "def jacobian(*_): return ((1, 2), (3, 4))",
            "gives 2 rows of 2, 2 rows of 3 are",
        ),
        (
            "odometry",
            "def travel(left, right, track, yaw): return left // 1, right, (right - left) / track",
            "travel(0.02, 0.03, 0.1, 0) gives 0, 0.03, 0.1, should be 0.0249688, 0.00124948, 0.1",
        ),
    ],
)
def test_a_mistake_that_nobody_knows_is_told_by_its_shape_or_by_an_example(
    name: str, code: str, hint: str, tmp_path: Path
) -> None:
    found = grade(EXERCISES[name], write(tmp_path, replaced(name, code)), seeds=(1,))
    assert not found.passed
    assert hint in found.hint


def test_what_follows_from_a_wrong_part_is_told_after_it(tmp_path: Path) -> None:
    """Also with a Jacobian that fits the wrong expectation."""
    code = "expected = lambda x, y, yaw, m: (m[0] - x, m[1] - y)\n"
    code += "jacobian = lambda *_: ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))"
    found = grade(EXERCISES["measurement"], write(tmp_path, replaced("measurement", code)), (1,))
    assert found.hint == mistakes.EXPECTED[0][1]


@pytest.mark.parametrize("place", ["def travel(*_): exit()", "exit()"])
def test_a_file_that_ends_the_program_does_not_pass(
    place: str, tmp_path: Path, capsys: Capture
) -> None:
    mine = write(tmp_path, replaced("odometry", place))
    assert cli.main(["grade", "odometry", str(mine)]) == 1
    assert f"{mine} ends the program: line " in capsys.readouterr().err


def test_a_loop_that_never_ends_is_told_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(patience, "PATIENCE", 1.0)
    mine = write(tmp_path, replaced("odometry", "def travel(*_):\n    while True: pass"))
    line = mine.read_text().splitlines().index("    while True: pass") + 1
    with pytest.raises(GradingError, match=f"at line {line}: does a loop there never end"):
        grade(EXERCISES["odometry"], mine, (1,))


def test_another_way_to_write_it_passes_too(tmp_path: Path) -> None:
    body = """\
    turn = (right - left) / track
    way = (left + right) / 2
    return way * cos(yaw + turn / 2), way * sin(yaw + turn / 2), turn
"""
    blank = EXERCISES["odometry"].blank()
    mine = re.sub(r"    # Your part.*\n    return .*\n", body, blank)
    assert mine != blank
    assert grade(EXERCISES["odometry"], write(tmp_path, mine)).passed


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("return 0.0, 0.0, 0.0", "return 0.0, 0.0, 0.0 / 0"), "line 23: ZeroDivisionError"),
        (("return 0.0, 0.0, 0.0", "return float('nan'), 0.0, 0.0"), ""),
        (("self.odom.send(", "str("), ""),
    ],
)
def test_what_raises_is_no_number_or_sends_nothing_does_not_pass(
    change: tuple[str, str], why: str, tmp_path: Path
) -> None:
    blank = EXERCISES["odometry"].blank()
    assert change[0] in blank
    found = grade(EXERCISES["odometry"], write(tmp_path, blank.replace(*change)), seeds=(1,))
    assert not found.passed
    assert found.raised.startswith(why)
    assert not found.raised or why
    assert not any(difference.fine for difference in found.differences) or found.sent


def test_what_is_no_number_is_told_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blank = EXERCISES["odometry"].blank()
    file = write(tmp_path, blank.replace("return 0.0, 0.0, 0.0", "return float('nan'), 0.0, 0.0"))
    assert cli.main(["grade", "odometry", str(file)]) == 1
    assert re.search(r"^x +is no number at 0\.\d+ s: wrong$", capsys.readouterr().out, re.M)
    assert cli.main(["grade", "odometry", str(file), "--json"]) == 1
    told = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert told["differences"]["x"]["worst"] is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("def odd(:\n", "does not load: line 1: SyntaxError"),
        ("import numpi\n", "does not load: line 1: ModuleNotFoundError: No module named 'numpi'"),
        ("x = 1\n", "must define exactly one node class, found none"),
    ],
)
def test_a_file_that_is_no_node_is_told_apart(text: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(GradingError, match=re.escape(why)):
        grade(EXERCISES["heading"], write(tmp_path, text))


def test_ports_are_to_be_left_alone(tmp_path: Path) -> None:
    text = (
        EXERCISES["heading"]
        .blank()
        .replace("    mag = ", "    compass = ")
        .replace("@mag", "@compass")
    )
    with pytest.raises(GradingError, match="no input mag of MagneticField"):
        grade(EXERCISES["heading"], write(tmp_path, text))


def test_the_verb_lists_writes_and_grades(tmp_path: Path, capsys: Capture) -> None:
    assert cli.main(["grade"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in EXERCISES)
    mine = str(tmp_path / "my_heading.py")
    assert cli.main(["grade", "heading", "--blank", mine]) == 0
    assert f"lodeline grade heading {mine}" in capsys.readouterr().out
    assert cli.main(["grade", "heading", "--blank", mine]) == 1
    assert "is there already, and stays as it is" in capsys.readouterr().err
    blank = Path(mine).read_text()
    Path(mine).write_text(blank.replace("    return 0.0\n", '    print("here")\n    return 0.0\n'))
    assert cli.main(["grade", "heading", mine, "--seed", "1", "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["passed"] is False
    assert report["differences"]["yaw"]["fine"] is False
    assert cli.main(["grade", "heading", str(EXERCISES["heading"].file), "--seed", "1"]) == 0
    assert capsys.readouterr().out.endswith("PASSED\n")


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["headin", "x.py"], "did you mean 'heading'?"),
        (["heading"], "which file?"),
        (["--blank", "x.py"], "of which exercise? (odometry, heading, measurement)"),
    ],
)
def test_wrong_words_are_usage_errors(arguments: list[str], why: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["grade", *arguments])
    assert stop.value.code == 2
    assert why in capsys.readouterr().err


def test_every_mistake_has_a_hint_of_its_own() -> None:
    lists: list[tuple[tuple[Callable[..., object], str], ...]] = [
        mistakes.TRAVEL,
        mistakes.HEADING,
        mistakes.EXPECTED,
        mistakes.JACOBIAN,
    ]
    for each in lists:
        assert len({hint for _, hint in each}) == len(each) >= 3
