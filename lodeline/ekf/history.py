"""A short history of samples by sensor stamp: late ones are put in their place and replayed.

What comes out depends on which samples came, not on their order of arrival. It knows stamps, not
estimation: what a motion or a detection does to a belief is given by two functions. They are called
when somebody asks for the newest belief, so several samples that came late are one replay.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, TypeVar

from lodeline.ekf.belief import made
from lodeline.ekf.samples import Fix, Heading, Hits, Landmarks, Measurement, Motion, Sample

B = TypeVar("B")


KINDS = {Motion: 0, Hits: 1, Heading: 2, Landmarks: 3, Fix: 4}  # their order at one stamp


class Mark(NamedTuple, Generic[B]):
    """What is believed at `stamp_ns`, and the last motion up to there (None: none yet)."""

    stamp_ns: int
    motion: Motion | None
    belief: B


@dataclass(slots=True)
class Node(Generic[B]):
    """A sample and what is believed after it, once it was worked out."""

    sample: Sample
    after: Mark[B] | None = None


Verdict = Literal["used", "waiting", "late", "duplicate", "full"]
Advance = Callable[[B, Motion, Motion, int, int], B]
"""belief, motion before, motion after, stamps [ns] of begin and end of the part taken."""
Observe = Callable[[B, Measurement], B]


class History(Generic[B]):
    """Samples of the last `span_ns` before the newest motion, replayed in the order of stamps.

    At one stamp the motion goes first. What is newer than the newest motion waits for the next; a
    motion that passes other samples is split at their stamps. What comes before the first motion
    changes nothing.
    """

    CAPACITY = 4096  # samples, against a flood: beyond it the oldest are settled early
    WAITING = 2048  # samples that may wait for a motion: a bar for 10 s of no odometry

    def __init__(
        self, span_ns: int, start: Mark[B], advance: Advance[B], observe: Observe[B]
    ) -> None:
        self._span_ns = span_ns
        self._advance, self._observe = advance, observe
        self.restart(start)

    def restart(self, start: Mark[B]) -> None:
        """Forgets all samples and goes on from `start`."""
        self._base, self._newest, self._motion = start, start, start.motion
        self._horizon = (-(1 << 63), 0) if start.motion is None else (start.stamp_ns, len(KINDS))
        self._keys: list[tuple[int, int]] = []
        self._nodes: list[Node[B]] = []
        self._stale = 0  # from this node on it is to be worked out (anew) what is believed

    @property
    def newest(self) -> Mark[B]:
        """The latest belief that all usable samples lead to."""
        if self._stale < len(self._nodes):
            self._replay()
        return self._newest

    @property
    def oldest_ns(self) -> int:
        """Stamp of what was settled last: nothing older will be worked out anew."""
        return self._base.stamp_ns

    def reaches(self, stamp_ns: int) -> bool:
        """False for a moment that is settled: what is learned of it now comes too late."""
        return stamp_ns >= self._horizon[0]

    def touch(self, stamp_ns: int) -> None:
        """All motion after this moment is to be worked out anew."""
        keys = self._keys
        if keys and keys[-1][0] > stamp_ns:
            self._stale = min(self._stale, bisect_left(keys, (stamp_ns + 1, 0)))

    def add(self, sample: Sample) -> Verdict:
        """Puts a sample in its place."""
        stamp_ns = sample.stamp_ns
        key = stamp_ns, KINDS[type(sample)]
        if key <= self._horizon:
            return "late"
        keys, motion = self._keys, self._motion
        i = len(keys) if not keys or key > keys[-1] else bisect_left(keys, key)
        if i < len(keys) and keys[i] == key:
            return "duplicate"
        if not isinstance(sample, Motion):
            until_ns = stamp_ns if motion is None else motion.stamp_ns
            if len(keys) >= self.WAITING and keys[-self.WAITING][0] > until_ns:
                return "full"
            self._insert(i, key, sample)
            self._crowd_out()
            return "waiting" if stamp_ns > until_ns else "used"
        # before the replay of all that waited, which needs the room
        i -= self._drop_before(stamp_ns - self._span_ns)
        self._insert(i, key, sample)
        nodes = self._nodes
        while i > 0 and not isinstance(nodes[i - 1].sample, Motion):  # its way is split anew
            i -= 1
        if i < self._stale:
            self._stale = i
        if motion is None or stamp_ns > motion.stamp_ns:
            self._motion = sample
            if (oldest := stamp_ns - self._span_ns) > self._horizon[0]:
                self._horizon = oldest, -1  # what is older comes too late, and is dropped sometime
        self._crowd_out()
        return "used"

    def _insert(self, i: int, key: tuple[int, int], sample: Sample) -> None:
        self._keys.insert(i, key)
        self._nodes.insert(i, Node(sample))
        if i < self._stale:
            self._stale = i

    def _replay(self) -> None:
        """Believes (anew) what the first stale sample and all that come after it lead to."""
        i, keys, nodes = self._stale, self._keys, self._nodes
        advance, observe = self._advance, self._observe
        mark = self._base if i == 0 else nodes[i - 1].after
        assert mark is not None  # else it would be stale too
        from_ns, before, belief = mark
        to: Motion | None = None
        for j in range(i, len(nodes)):
            node, stamp_ns = nodes[j], keys[j][0]
            sample = node.sample
            if before is not None and stamp_ns > from_ns:
                if to is None or to is before:
                    to = self._coming(j)
                    if to is None:
                        break  # from here on all wait
                belief = advance(belief, before, to, from_ns, stamp_ns)
            if isinstance(sample, Motion):
                before = sample
            elif before is not None:
                belief = observe(belief, sample)
            from_ns = stamp_ns
            node.after = mark = made(Mark, (stamp_ns, before, belief))
            self._stale = j + 1
        self._newest = mark

    def _coming(self, j: int) -> Motion | None:
        """The next motion from sample `j` on."""
        if self._motion is None or self._motion.stamp_ns < self._keys[j][0]:
            return None
        for k in range(j, len(self._nodes)):
            sample = self._nodes[k].sample
            if isinstance(sample, Motion):
                return sample
        return None

    def _drop_before(self, oldest: int) -> int:
        """Drops what is older, once it is an eighth of the span; how many samples that were."""
        keys = self._keys
        if not keys or keys[0][0] >= oldest - self._span_ns // 8:
            return 0
        return self._drop(bisect_left(keys, (oldest, 0)))

    def _crowd_out(self) -> None:
        """Drops the oldest of too many samples."""
        if len(self._keys) > self.CAPACITY:
            self._drop(len(self._keys) - self.CAPACITY)

    def _drop(self, count: int) -> int:
        """Drops the oldest samples but those that wait; what they led to stays as the base."""
        if self._stale < count:
            self._replay()
        count = min(count, self._stale)
        if count > 0:
            base = self._nodes[count - 1].after
            assert base is not None
            self._base, self._horizon = base, max(self._horizon, self._keys[count - 1])
            self._stale -= count
            del self._keys[:count], self._nodes[:count]
        return count
