"""A supervisor over fake nodes, without a pipeline and without zenoh: `fake_up.py JSON`."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

from lodeline.run_folder import Manifest, RunFolder, RunFolderError, marker_of
from lodeline.supervisor.backoff import BackoffParams
from lodeline.supervisor.logs import Console
from lodeline.supervisor.plan import Plan, Timing
from lodeline.supervisor.supervisor import Supervisor

NODE = Path(__file__).with_name("fake_node.py")


def plan(name: str, mode: str, options: dict[str, Any]) -> Plan:
    return Plan(
        name=name,
        host="robot",
        nodes=(name,),
        command=(sys.executable, "-P", "-S", str(NODE), mode),
        launch=lambda restarts: f"#{restarts}",
        **options,
    )


def main() -> int:
    order = json.loads(sys.argv[1])
    timing = dict(order["timing"])
    timing["backoff"] = BackoffParams(**timing.get("backoff", {}))
    plans = [plan(name, mode, options) for name, mode, options in order["nodes"]]
    try:
        run = RunFolder("fakes", ["robot"])
    except RunFolderError as error:
        print(error, file=sys.stderr)
        return 1
    with run:
        console = Console(2, [item.name for item in plans], colour=False)
        console.event(f"leftovers {run.leftovers}")
        run.publish(Manifest("fakes", ("robot",), 1, 0.0, "", "", "host", {}, {}))
        supervisor = Supervisor(
            plans,
            run.path,
            console,
            [marker_of(run.path)],
            Timing(**timing),
            lambda: console.event("released"),
        )

        async def watched() -> int:
            running = asyncio.ensure_future(supervisor.run(order["seconds"]))
            while not running.done():
                await asyncio.wait([running], timeout=0.05)
                print(json.dumps({"guard": supervisor.groups.guard_pid}), flush=True)
            return running.result()

        code = asyncio.run(watched())
        report = supervisor.report()
        console.event("report " + json.dumps(report["processes"]))
        console.close()
    return code


if __name__ == "__main__":
    sys.exit(main())
