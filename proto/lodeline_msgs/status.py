"""The message in which a node reports on itself, once a second."""

from typing import Annotated

from lodeline_msgs.definition import Message, Unit, message


@message
class NodeStatus(Message):
    """How a node fares: what it sends and receives, what it lost, what it costs.

    Rates and ages are over the last second; counts, also of what was lost, since the node started.
    """

    node: Annotated[str, Unit("", "name in the pipeline file")]
    host: Annotated[str, Unit("", "name of its host in the pipeline file")]
    state: Annotated[str, Unit("", "running, degraded or fault")]
    pid: Annotated[int, Unit("1", "process id on its host")]
    pipeline: Annotated[str, Unit("", "hash of the pipeline it was started from")]
    rates: Annotated[dict[str, float], Unit("Hz", "sent, by key")]
    bandwidths: Annotated[dict[str, float], Unit("B/s", "packed and sent, by key")]
    age_p50: Annotated[dict[str, float], Unit("s", "median age on arrival, by key received")]
    age_p99: Annotated[dict[str, float], Unit("s", "99th percentile of it, by key received")]
    received: Annotated[dict[str, int], Unit("1", "samples taken in, by key")]
    lost: Annotated[dict[str, int], Unit("1", "samples missing in the numbering, by key")]
    late: Annotated[dict[str, int], Unit("1", "samples refused as too old, by key")]
    rejected: Annotated[dict[str, int], Unit("1", "samples refused, by cause")]
    restarts: Annotated[int, Unit("1", "times the supervisor started it again")]
    cpu: Annotated[float, Unit("1", "part of one core, whole process")]
    rss: Annotated[int, Unit("B", "resident memory of its process")]
    last_error: Annotated[str, Unit("", "what went wrong last, empty if nothing did")]
    jitter: Annotated[float, Unit("s", "99th percentile of how late a driver's ticks began")] = 0.0
