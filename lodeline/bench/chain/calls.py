"""What the nodes of the chain compute, as plain function calls, then one hop over plain zenoh.

No node, no message class, no check: the least that these estimates cost in Python.
"""

from __future__ import annotations

import os
import time

import zenoh

from lodeline.attitude.soft import Soft, SoftParams
from lodeline.bench.chain.ends import Sent, Stop, paced
from lodeline.bench.chain.raw import config, declare, packer, parser, sink, wait_matched
from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.ekf import Localizer, LocalizerParams
from lodeline.odometry import Odometry, OdometryParams


def main() -> None:
    """Be the process that computes (stage 0), or the subscriber (stage 1), until SIGTERM."""
    arguments = parser().parse_args()
    stop = Stop()
    session = zenoh.open(config(arguments.folder, arguments.stage, arguments.tuned))
    try:
        if arguments.stage:
            heard = sink(session, arguments.folder, 0, arguments.tuned)
            stop.wait()
            heard.write()
        else:
            compute(session, arguments.folder, arguments.rate, stop)
    finally:
        os._exit(0)


def compute(session: zenoh.Session, folder: str, rate: float, stop: Stop) -> None:
    """From a reading of the IMU to a packed pose, `rate` times a second."""
    calibrator = Calibrator(ImuCalibration())
    attitude = Soft(SoftParams())
    odometry = Odometry(OdometryParams(wheel_radius=0.0215, track=0.112, ticks_per_turn=16384))
    localizer = Localizer(LocalizerParams())
    publisher, pack, sent = declare(session, 0), packer(), Sent(folder)
    wait_matched(publisher)
    last = time.monotonic_ns()
    for number in paced(rate, stop):
        stamp = time.monotonic_ns()
        w = calibrator.angular_velocity((0.0, 0.0, 0.1))
        a = calibrator.linear_acceleration((0.0, 0.0, 9.81))
        attitude.update((stamp - last) * 1e-9, w, a)
        last = stamp
        odom = odometry.update(stamp, number, number)
        if odom is None:
            continue
        pose = localizer.odometry(
            stamp, odom.x, odom.y, odom.yaw, odom.twist_covariance, odom.interval, odom.resets
        )
        if pose is None:
            continue
        values = (pose.x, pose.y, pose.yaw, pose.covariance, pose.nis, pose.rejected)
        data = pack({"stamp": stamp, "seq": number, "values": values})
        sent.done(time.monotonic_ns() - stamp)
        publisher.put(data)
        sent.add(stamp)
    sent.write()


if __name__ == "__main__":
    main()
