"""A short history of samples by sensor stamp: late ones are put in their place and replayed.

What comes out depends on which samples came, not on their order of arrival. It knows stamps, not
estimation: what a motion or a detection does to a belief is given by two functions.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, TypeVar

from lodeline.ekf.samples import Fix, Hits, Landmarks, Measurement, Motion, Sample, Spin

B = TypeVar("B")


KINDS = (Motion, Hits, Spin, Landmarks, Fix)  # in the order that they take at one stamp


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
    WAITING = 512  # samples that may wait for a motion

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
        key = (sample.stamp_ns, KINDS.index(type(sample)))
        if key <= self._horizon:
            return "late"
        i = bisect_left(self._keys, key)
        if i < len(self._keys) and self._keys[i] == key:
            return "duplicate"
        if key[1] and self._waiting() >= self.WAITING:
            return "full"
        self._keys.insert(i, key)
        node: Node[B] = Node(sample)
        self._nodes.insert(i, node)
        while i > 0 and self._between(self._nodes[i - 1]):  # its way is split anew
            i -= 1
        self._replay(i)
        verdict: Verdict = "waiting" if node.after is None else "used"
        self._settle()
        return verdict

    @staticmethod
    def _between(node: Node[B]) -> bool:
        """True for a sample between two motions: what is believed there hangs on the next one."""
        if isinstance(node.sample, Motion):
            return False
        motion = node.after.motion if node.after else None
        return motion is None or motion.stamp_ns < node.sample.stamp_ns

    def _waiting(self) -> int:
        """How many samples no motion has reached; they are the last ones, without a gap."""
        count = 0
        while count < len(self._nodes) and self._nodes[-1 - count].after is None:
            count += 1
        return count

    def _replay(self, i: int) -> None:
        mark = self._base
        if i > 0:
            before = self._nodes[i - 1].after
            assert before is not None  # else the replay would have begun before it
            mark = before
        coming = i
        for j in range(i, len(self._nodes)):
            node = self._nodes[j]
            coming = max(coming, j)
            while coming < len(self._nodes) and self._keys[coming][1] > 0:
                coming += 1
            to = self._nodes[coming].sample if coming < len(self._nodes) else None
            assert to is None or isinstance(to, Motion)
            after = self._step(mark, node.sample, to)
            node.after = after
            if after is not None:
                mark = after
        self._newest = mark

    def _step(self, mark: Mark[B], sample: Sample, to: Motion | None) -> Mark[B] | None:
        """`to`: the next motion at or after the sample."""
        before, stamp_ns = mark.motion, sample.stamp_ns
        if before is None:
            motion = sample if isinstance(sample, Motion) else None
            return Mark(stamp_ns, motion, mark.belief)
        belief = mark.belief
        if stamp_ns > mark.stamp_ns:
            if to is None:
                return None
            way = to.stamp_ns - before.stamp_ns
            begin = (mark.stamp_ns - before.stamp_ns) / way
            end = (stamp_ns - before.stamp_ns) / way
            belief = self._advance(belief, before, to, begin, end)
        if isinstance(sample, Motion):
            return Mark(stamp_ns, sample, belief)
        return Mark(stamp_ns, before, self._observe(belief, sample))

    def _settle(self) -> None:
        """Drops samples older than the span; what they led to stays as the base."""
        motion = self._newest.motion
        if motion is None:
            return
        oldest = motion.stamp_ns - self._span_ns
        count = bisect_left(self._keys, (oldest, 0))
        count = max(count, len(self._keys) - self.CAPACITY)
        while count > 0 and self._nodes[count - 1].after is None:
            count -= 1
        if count > 0:
            base = self._nodes[count - 1].after
            assert base is not None
            self._base, self._horizon = base, self._keys[count - 1]
            del self._keys[:count], self._nodes[:count]
        # also where nothing was dropped, what is older than the span comes too late
        self._horizon = max(self._horizon, (oldest, -1))
