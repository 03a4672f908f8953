"""Dead reckoning: a calibrated IMU to a pose that drifts fast; see how it compares with wheels."""

from __future__ import annotations

from lodeline import dead_reckoning
from lodeline.dead_reckoning import DeadReckoningParams, DeadReckoningState
from lodeline.node import Input, Node, Output
from lodeline.stamps import Steps
from lodeline_msgs import Imu, Odometry


class DeadReckoningNode(Node[DeadReckoningParams]):
    """`data` in, `odom` out, one for one; the robot must rest when it starts."""

    State = DeadReckoningState
    data = Input(Imu, queue=64, max_age=0.5)
    odom = Output(Odometry)

    def setup(self) -> None:
        self.reckoning = dead_reckoning.DeadReckoning(self.params)
        self.steps = Steps()

    @data.handler
    def on_data(self, sample: Imu) -> None:
        step = self.steps.take(sample.stamp)
        if step is None:
            self.context.reject("stamp not newer")
            return
        self.reckoning.update(step, sample.angular_velocity, sample.linear_acceleration)
        estimate = self.reckoning.estimate
        self.odom.send(
            Odometry(
                stamp=sample.stamp,
                x=estimate.x,
                y=estimate.y,
                yaw=estimate.yaw,
                v=estimate.v,
                w=estimate.w,
                pose_covariance=estimate.pose_covariance,
                twist_covariance=estimate.twist_covariance,
                interval=step,
            )
        )

    def save(self) -> DeadReckoningState:
        return self.reckoning.state

    def resume(self, state: DeadReckoningState) -> None:
        self.reckoning.resume(state)


if __name__ == "__main__":
    from lodeline.process import run

    run(DeadReckoningNode)
