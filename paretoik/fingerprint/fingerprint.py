"""The fingerprint of a problem, by which a run knows it again."""

from __future__ import annotations

from paretoik.errors import InvalidInput
from paretoik.fingerprint.digest import Digester

SCHEME = "2"  # of digests; another where they come to be made in another way


def fingerprint(problem: object) -> str:
    """Return a digest of everything that gives a problem's genes their objectives, "SCHEME:DIGEST".

    All attributes of the problem count, field by field: arm, paths, limits, obstacles, functions with their code, their
    defaults, and the values of their closures and globals; of a user's own problem its class too. Code counts by its
    syntax, without comments, layout, annotations and documentation; where its source is not at hand, or not what runs,
    by its bytecode and Python's version. Code of installed libraries counts by name. What problem and functions change
    themselves while they are evaluated, counts and caches, does not count, nor does where a file is.

    Two attributes of a class say more: ``computed_attributes`` follow from the others and are compared to 6 decimals,
    as processors differ in the last bits; ``search_attributes`` say how solutions are searched for, and do not count.
    A problem on more samples than the user's, ``finer_than``, has the fingerprint of the user's.
    """
    given = getattr(problem, "finer_than", None)
    return f"{SCHEME}:{Digester().digest(problem if given is None else given).hex()}"


def check_fingerprint(problem: object, stored: object, *, wish: str) -> None:
    """Raise InvalidInput, which begins with ``wish``, where a problem is not the one with a stored fingerprint.

    One of another scheme is a run's that another version of paretoik made: whether it is of the problem nobody knows.
    """
    if not isinstance(stored, str) or not stored.startswith(f"{SCHEME}:"):
        raise InvalidInput(
            f"{wish}, got a run of another version of paretoik, whose fingerprints cannot be compared: whether it is "
            "of this problem is not known"
        )
    if fingerprint(problem) != stored:
        raise InvalidInput(f"{wish}, got one whose fingerprint is another")
