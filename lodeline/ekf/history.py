"""A short history of samples by sensor stamp: late ones are put in their place and replayed.

What comes out depends on which samples came, not on their order of arrival. It knows stamps, not
estimation: what a motion or a detection does to a belief is given by two functions.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, TypeVar

from lodeline.ekf.belief import made
from lodeline.ekf.samples import Fix, Hits, Landmarks, Measurement, Motion, Sample, Spin

B = TypeVar("B")


KINDS = {Motion: 0, Hits: 1, Spin: 2, Landmarks: 3, Fix: 4}  # their order at one stamp


class Mark(NamedTuple, Generic[B]):
    """What is believed at `stamp_ns`, and the last motion up to there (None: none yet)."""

    stamp_ns: int
    motion: Motion | None
    belief: B


@dataclass(slots=True)
class Node(Generic[B]):
    """A sample and what is believed after it (None: it waits for a motion that reaches it)."""

    sample: Sample
    after: Mark[B] | None = None


Verdict = Literal["used", "waiting", "late", "duplicate", "full"]
Advance = Callable[[B, Motion, Motion, float, float], B]
"""belief, motion before, motion after, begin and end of the part taken (fractions of the way)."""
Observe = Callable[[B, Measurement], B]


class History(Generic[B]):
    """Samples of the last `span_ns` before the newest motion, replayed in the order of stamps.

    At one stamp the motion goes first. What is newer than the newest motion waits for the next; a
    motion that passes other samples is split at their stamps. What comes before the first motion
    changes nothing.
    """

    CAPACITY = 4096  # samples, against a flood: beyond it the oldest are settled early
    WAITING = 2048  # samples that may wait for a motion: gyro and bar for 6 s of no odometry

    def __init__(
        self, span_ns: int, start: Mark[B], advance: Advance[B], observe: Observe[B]
    ) -> None:
        self._span_ns = span_ns
        self._advance, self._observe = advance, observe
        self.restart(start)

    def restart(self, start: Mark[B]) -> None:
        """Forgets all samples and goes on from `start`."""
        self._base = start
        self._horizon = (-(1 << 63), 0) if start.motion is None else (start.stamp_ns, len(KINDS))
        self._keys: list[tuple[int, int]] = []
        self._nodes: list[Node[B]] = []
        self._newest = start

    @property
    def newest(self) -> Mark[B]:
        """The latest belief that all usable samples lead to."""
        return self._newest

    def add(self, sample: Sample) -> Verdict:
        """Puts a sample in its place and replays what comes after it."""
        keys, nodes, newest = self._keys, self._nodes, self._newest
        stamp_ns, kind = key = (sample.stamp_ns, KINDS[type(sample)])
        if key <= self._horizon:
            return "late"
        i = len(keys) if not keys or key > keys[-1] else bisect_left(keys, key)
        if i < len(keys) and keys[i] == key:
            return "duplicate"
        if kind and len(nodes) >= self.WAITING and nodes[-self.WAITING].after is None:
            return "full"
        if not kind and keys:  # before the replay of all that waited, which needs their room
            self._drop_before(stamp_ns - self._span_ns)
            i = bisect_left(keys, key)
        node: Node[B] = Node(sample)
        keys.insert(i, key)
        nodes.insert(i, node)
        if kind and newest.motion is None:  # it changes nothing
            node.after = Mark(stamp_ns, None, newest.belief)
            self._newest = nodes[-1].after or newest
            self._crowd_out()
            return "used"
        if kind and stamp_ns > newest.stamp_ns:  # nothing is believed there until the next motion
            self._crowd_out()
            return "waiting"
        while not kind and i > 0 and self._between(nodes[i - 1]):  # its way is split anew
            i -= 1
        self._replay(i)
        self._settle()
        return "waiting" if node.after is None else "used"

    @staticmethod
    def _between(node: Node[B]) -> bool:
        """True for a sample between two motions: what is believed there hangs on the next one."""
        if isinstance(node.sample, Motion):
            return False
        motion = node.after.motion if node.after else None
        return motion is None or motion.stamp_ns < node.sample.stamp_ns

    def _replay(self, i: int) -> None:
        """Believes anew what sample `i` and all that come after it lead to."""
        keys, nodes, advance, observe = self._keys, self._nodes, self._advance, self._observe
        mark = self._base if i == 0 else nodes[i - 1].after
        assert mark is not None  # else the replay would have begun before it
        from_ns, before, belief = mark
        to: Motion | None = None
        for j in range(i, len(nodes)):
            node, stamp_ns = nodes[j], keys[j][0]
            sample = node.sample
            if before is not None and stamp_ns > from_ns:
                since = before.stamp_ns
                if to is None or to is before:
                    to = self._coming(j)
                    if to is None:
                        break  # from here on all wait
                way = to.stamp_ns - since
                begin, end = (from_ns - since) / way, (stamp_ns - since) / way
                belief = advance(belief, before, to, begin, end)
            if isinstance(sample, Motion):
                before = sample
            elif before is not None:
                belief = observe(belief, sample)
            from_ns = stamp_ns
            node.after = mark = made(Mark, (stamp_ns, before, belief))
        self._newest = mark

    def _coming(self, j: int) -> Motion | None:
        """The next motion from sample `j` on."""
        for k in range(j, len(self._nodes)):
            sample = self._nodes[k].sample
            if isinstance(sample, Motion):
                return sample
        return None

    def _settle(self) -> None:
        """What is older than the span comes too late from now on, and is dropped sometime."""
        motion = self._newest.motion
        if motion is None:
            return
        oldest = motion.stamp_ns - self._span_ns
        self._crowd_out()
        self._horizon = max(self._horizon, (oldest, -1))

    def _drop_before(self, oldest: int) -> None:
        """Drops what is older, once it is an eighth of the span."""
        if self._keys[0][0] < oldest - self._span_ns // 8:
            self._drop(bisect_left(self._keys, (oldest, 0)))

    def _crowd_out(self) -> None:
        """Drops the oldest of too many samples."""
        if len(self._keys) > self.CAPACITY:
            self._drop(len(self._keys) - self.CAPACITY)

    def _drop(self, count: int) -> None:
        """Drops the oldest samples but those that wait; what they led to stays as the base."""
        while count > 0 and self._nodes[count - 1].after is None:
            count -= 1
        if count > 0:
            base = self._nodes[count - 1].after
            assert base is not None
            self._base, self._horizon = base, self._keys[count - 1]
            del self._keys[:count], self._nodes[:count]
