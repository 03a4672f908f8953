"""Dead reckoning: a calibrated IMU to a pose that drifts fast; see how it compares with wheels."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from lodeline import dead_reckoning
from lodeline.dead_reckoning import DeadReckoningParams, DeadReckoningState
from lodeline.node import Input, Node, Output
from lodeline.stamps import Steps
from lodeline_msgs import Imu, Odometry


@dataclass(slots=True)
class NodeState(DeadReckoningState):
    """And the stamp of the last sample, so that a successor knows how long nobody looked."""

    stamp: int | None = None


class DeadReckoningNode(Node[DeadReckoningParams]):
    """`data` in, `odom` out, one for one; the robot must rest when it starts."""

    State = NodeState
    data = Input(Imu, queue=256, max_age=0.5)
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

    def save(self) -> NodeState:
        return NodeState(**{**asdict(self.reckoning.state), "stamp": self.steps.last})

    def resume(self, state: NodeState) -> None:
        self.reckoning.resume(state)
        self.steps.last = state.stamp


if __name__ == "__main__":
    from lodeline.process import run

    run(DeadReckoningNode)
