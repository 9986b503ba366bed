"""Small smooth programs for tests."""

from __future__ import annotations

import numpy as np

from paretoik.nlp.traced import smooth
from paretoik.pareto.refine import Sketch


def sketched(unknowns, values, within=lambda x: ([], [])):
    """Objectives are the last unknowns, each no less than its value; ``within`` gives further rows."""

    def rows(z, known):
        x = z[:unknowns]
        found = values(x)
        equal, room = within(x)
        return equal, [*(z[unknowns + k] - value for k, value in enumerate(found)), *room]

    count = len(values(np.zeros(unknowns)))
    program = smooth(unknowns + count, 0, rows)
    return Sketch(program=program, costs=np.eye(unknowns + count)[unknowns:])
