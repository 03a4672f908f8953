"""Many subscribers of one key, each a tool of its own at the hub: how old each sample is."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from lodeline.clock import HostClock, epoch_offset
from lodeline.run_folder import running
from lodeline.sessions import Client
from lodeline_msgs import PoseEstimate, unpacker_of


def main() -> None:
    """Listen for some seconds, then print [samples, median age, 99th percentile] as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("count", type=int)
    parser.add_argument("seconds", type=float)
    arguments = parser.parse_args()
    (found,) = running(base=arguments.run)
    clock, ages, unpack = HostClock(epoch_offset()), list[float](), unpacker_of(PoseEstimate)

    def take(_key: str, data: bytes, _encoding: str) -> None:
        ages.append((clock.now() - unpack(data).stamp) * 1e-9)

    clients = [Client(found.folder) for _ in range(arguments.count)]
    for client in clients:
        client.subscribe(f"{found.manifest.name}/pose", 256, take)
    time.sleep(0.5)
    print("go", flush=True)
    ages.clear()
    time.sleep(arguments.seconds)
    heard = sorted(ages)
    print(json.dumps([len(heard), heard[len(heard) // 2], heard[int(0.99 * len(heard))]]))
    for client in clients:
        client.close()


if __name__ == "__main__":
    main()
