"""What a reading of the reed bar does to the track: sights, their association, the verdict."""

from lodeline.ekf.association import Association
from lodeline.ekf.belief import made
from lodeline.ekf.mixture import Hypothesis, Mixture
from lodeline.ekf.params import LocalizerParams
from lodeline.ekf.reeds import BarMemory, Contact, ReedModel, Sight, edge_sights, plain_sights
from lodeline.ekf.samples import Hits
from lodeline.ekf.track import Track

NOTHING = BarMemory((), way=0.0)  # neither under the bar nor met lately
STUCK_PITCHES = 3.0  # a reed that stays closed over so much of the lattice is stuck


class Bar:
    """Pure steps from track to track, one for each reading of the bar."""

    def __init__(self, association: Association, params: LocalizerParams) -> None:
        self._association, self._params = association, params
        self._reeds = ReedModel(params.passage, params.edge_sigma, params.lateral_sigma)

    def read(self, track: Track, hits: Hits) -> Track:
        """After a reading: each sight is gated, then corrects the belief."""
        if track.pace.unmeasured:  # the magnet of before or the next? when the gap is over it tells
            return track
        if not (hits.laterals or track.bar.contacts):
            return track.read(NOTHING)
        torn = self._is_torn(track, hits)
        sights, contacts = self._sights(track, hits, sharp=torn)
        alarms = track.trust.alarms
        for sight in sights:
            track = self._seen(track, sight, torn=torn)
        if track.trust.alarms != alarms:
            contacts = ()  # which magnets these were is open again
        return track.read(BarMemory(contacts, way=0.0))

    def distances(self, track: Track, hits: Hits) -> list[tuple[float, list[float]]]:
        """How a reading tells magnets apart: see `Association.distances`, for each fresh sight.

        Sights are sharp: a magnet met is told once, by its passage as a whole.
        """
        if track.pace.unmeasured:
            return []
        sights, _ = self._sights(track, hits, sharp=True)
        return [self._association.distances(track.belief, sight) for sight in sights if sight.fresh]

    def _is_torn(self, track: Track, hits: Hits) -> bool:
        """Whether a reading may be of other magnets than the nearest."""
        return track.torn or (
            self._params.association == "mixture"
            and self._association.is_wide(track.belief)
            and self._association.is_torn(track.belief, plain_sights(self._reeds, hits.laterals))
        )

    def _sights(
        self, track: Track, hits: Hits, *, sharp: bool
    ) -> tuple[list[Sight], tuple[Contact, ...]]:
        """What a reading shows, and its magnets for the next one."""
        if self._params.magnet_model == "edges":
            return edge_sights(self._reeds, track.bar, hits.laterals, sharp=sharp)
        return plain_sights(self._reeds, hits.laterals), ()

    def has_stuck_reed(self, track: Track) -> bool:
        """True while a reed stays closed farther than any magnet holds it."""
        contacts, limit = track.bar.contacts, STUCK_PITCHES * self._params.lattice_pitch
        return bool(contacts) and any(
            each.since_last == 0.0 and abs(each.since_first) > limit for each in contacts
        )

    def _seen(self, track: Track, sight: Sight, *, torn: bool) -> Track:
        if torn:
            mixture, nis, rejected = self._association.branch(track.mixture, sight)
            return track if nis is None else self._judged(track, mixture, nis, rejected=rejected)
        ((weight, belief),) = track.mixture
        if not sight.fresh and self._association.is_wide(belief):
            # a reed that opens tells nothing across, but which magnet it was must be clear there
            nominal = self._reeds.sight(sight.lateral, sight.offset, sight.offset)
            if self._association.is_torn(belief, (nominal,)):
                return track
        belief, nis, passed = self._association.single(belief, sight)
        return self._judged(track, (made(Hypothesis, (weight, belief)),), nis, rejected=not passed)

    def _judged(self, track: Track, mixture: Mixture, nis: float, *, rejected: bool) -> Track:
        """Counts a verdict; too many rejections among the last mean that the pose is wrong."""
        trust = track.trust.after_sight(nis, rejected=rejected)
        track = track._replace(mixture=mixture, trust=trust)
        if trust.refusals < self._params.widen_after:
            return track
        return track.alarmed(*self._params.widen_sigma)
