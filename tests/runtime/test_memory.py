"""Claims about what a process does with the memory that its start took."""

from __future__ import annotations

import json
import subprocess
import sys

MEGABYTE = 1e6
PROGRAM = """
import json, re, sys
import numpy as np
import zenoh
from lodeline.memory import WORKING_S, IdleCode

def of_files():
    with open("/proc/self/status") as file:
        return int(re.search(r"RssFile:\\s*(\\d+)", file.read())[1]) * 1024

quiet = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
zenoh.open(quiet).close()
solved = np.linalg.inv(np.arange(9.0).reshape(3, 3) + np.eye(3)).tolist()
idle_code = IdleCode(100.0)
sizes = [of_files()]
for now in (100.0 + 0.9 * WORKING_S, 100.0 + 1.1 * WORKING_S):
    idle_code.look(now)
    sizes.append(of_files())
again = np.linalg.inv(np.arange(9.0).reshape(3, 3) + np.eye(3)).tolist()
idle_code.look(1e6)
print(json.dumps([*sizes, of_files(), again == solved]))
"""


def test_code_that_only_the_start_ran_is_let_go_once_and_comes_back_when_needed() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    start, too_early, let_go, later, same = json.loads(done.stdout)
    assert abs(too_early - start) < 0.5 * MEGABYTE
    assert let_go < start - 5.0 * MEGABYTE
    assert later > let_go  # not let go a second time
    assert same
