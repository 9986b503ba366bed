"""Bad inputs that are accepted because they have a meaning."""

from __future__ import annotations

from fnmatch import fnmatchcase

ACCEPTED = {
    "Bounds(then): huge integer": "the id of a point, looked for in the front when it chooses",
    "Bounds(then): *": "the id of a point, looked for in the front when it chooses",
    "Classify(current): huge integer": "the id of a point, looked for in the front when it chooses",
    "Front(problem): *": "whatever the front was made of; a verb that needs it asks for what it needs",
    "TimeOptimalControl(*): array of overflow": "a number for each of a batch of motions",
    "capability.kim_sliders(bend): negative": "the other way in which joints bend",
    "Limits(*): None": "the arm's own limits",
    "Limits(*): *mapping": "limits by joint, held against the joints when there is an arm",
    "Limits(*): array of 97": "one limit a joint, held against the joints when there is an arm",
    "MaxiMin*(*tolerance): array of 97": "one tolerance a constraint, held against them when there is a problem",
    "MaxiMinNSGA2(sampling): list of truth values": "genes of a binary problem",
    "MaxiMinNSGA2(sampling): array of 97": "genes, held against the problem's when there is one",
    "Motion.at(t): array of 97": "times, all of them 0",
    "Motion.state(t): array of 97": "times, all of them 0",
    "Motion.integral(series): NaN": "the value of a failed evaluation",
    "Path.at(t): array of *": "times of any shape, all of them 0",
    "Path.rates(t): array of 97": "times, all of them 0",
    "arms.kim_3r(masses): None": "an arm without masses",
    "methods.*(*): array of *": "a number for each of a batch of motions",
    "methods.*(*): empty list": "a number for each of a batch of no motions",
}
"""Reasons by patterns of cases."""


def reason(case: str) -> str | None:
    """Return why a case is accepted, by its name; None if it must not be."""
    return next((why for pattern, why in ACCEPTED.items() if fnmatchcase(case, pattern)), None)
