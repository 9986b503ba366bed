"""How fronts are swept by ε-constraints."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.nlp.interior_point_options import InteriorPointOptions


@dataclass(frozen=True, kw_only=True)
class EpsilonOptions:
    """How a front is swept; objectives are divided by their ranges, so that values here are shares of these.

    ``end_tolerance`` is what an objective gives way for the others at an end of the front, ``end_weight`` the weight of
    the others there at first. Where a range of the ends is ``narrower`` than that of the objectives' own optima, by so
    much of it, they are sought once more with objectives divided by the ends' ranges. ``weight`` is that of the others
    at any ε: with none a point may be only weakly optimal. Where the ends are within ``resolved_distance`` (rad or
    lengths of the arm, RMS) and ``resolution`` of every objective's size, the front is one point: that is what a
    solver's last barrier leaves open.

    Of two objectives the first ``cold_points`` are sought from cold starts too, as a branch may belong to no
    objective's own optimum, and the best ``cold_optima`` of each search looked at. The second neighbour's motion is a
    start where that of the nearer one ``falls_short`` of the expected gain, by a share of it. So many points more than
    wanted are solved at most as ``further`` says, or ``further_share`` of these. Bounds of points are at even places of
    a gap, ``grid`` in number. Of more objectives each is sought from cold starts once, at ``inner``
    between nadir and ideal, and every ε starts from the ``nearest`` points. Each point tries the basins of its
    ``neighbours``, in at most so many ``rounds`` of ``basin_iterations`` each. So many points are minimised at a time
    as ``batch`` says.

    The barriers: ``warm`` from a point near by; ``cold`` and ``near`` where ends are tried once more: from a flat
    valley one may get lost, or find a better one.
    """

    end_tolerance: float = 1e-6
    end_weight: float = 1e-3
    narrower: float = 0.5
    weight: float = 5e-4
    cold_points: int = 3
    cold_optima: int = 4
    inner: float = 0.5
    falls_short: float = 0.02
    further: int = 4
    further_share: float = 0.5
    grid: int = 256
    nearest: int = 4
    neighbours: int = 2
    rounds: int = 3
    basin_iterations: int = 60
    batch: int = 8
    resolution: float = 1e-7
    resolved_distance: float = 1e-3
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = EpsilonOptions()
