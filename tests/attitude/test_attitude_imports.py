"""Claims about what the algorithms pull in: nodes start often, on small machines."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_attitude_and_calibration_load_without_numpy() -> None:
    code = (
        "import sys, lodeline.attitude, lodeline.calibration, lodeline.calibration.minmax,"
        " lodeline.calibration.compass, lodeline.calibration.still;"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'numpy', 'zenoh', 'scipy',"
        " 'lodeline_msgs'}))"
    )
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"
