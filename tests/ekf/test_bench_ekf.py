"""Claims about `lodeline bench ekf`: its figures, within one run, and what it prints."""

import json

import pytest

from lodeline.bench import ekf


def test_magnets_400_ms_late_are_fused_by_their_stamps() -> None:
    """Taken for fresh, they put the robot into a wrong cell in a third of the runs or more."""
    _, fresh, reeds, by_stamp, as_fresh = ekf.late(16, (0.0, 0.4))
    print(fresh, reeds, by_stamp, as_fresh)
    assert reeds["aliased_%"] == by_stamp["aliased_%"] == 0.0
    assert reeds["rms_mm"] <= 2.5
    assert by_stamp["rms_mm"] <= 3.0
    assert by_stamp["rms_mm"] <= 1.35 * fresh["rms_mm"]
    assert as_fresh["aliased_%"] >= 30.0


def test_the_scalar_engine_is_twelve_times_as_fast_as_filterpy() -> None:
    """A prediction and a gated update; the better of three tries, for a busy machine's sake."""
    ratios = []
    for _ in range(3):
        scalar, filterpy = ekf.speed()
        assert scalar["times_scalar"] == 1.0
        ratios.append(filterpy["times_scalar"])
        if ratios[-1] >= 12.0:
            break
    print(ratios)
    assert max(ratios) >= 12.0


def test_it_prints_a_table_or_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert ekf.main(["--runs", "1"]) == 0
    tables = capsys.readouterr().out
    assert "ALIASED %" in tables
    assert "nearest" in tables
    assert ekf.main(["--runs", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["late_ms"] for row in found["late"]] == [0, 0, *[200] * 3, *[400] * 3]
    assert {row["model"] for row in found["nees"]} == {"plain", "edges"}
    assert {row["association"] for row in found["hidden"]} == {"nearest", "mixture"}


def test_no_runs_are_no_measurement() -> None:
    with pytest.raises(SystemExit, match="2"):
        ekf.main(["--runs", "0"])
