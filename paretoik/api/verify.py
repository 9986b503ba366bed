"""Check a run folder a second time, independently of what made it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.api.load import check_problem_argument, how_to_name, named_problem
from paretoik.api.progress import Observer, count_observer, open_observer
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import at_samples_of
from paretoik.inputs import check_call, file_path
from paretoik.runs.file_replacement import without_writers
from paretoik.runs.fingerprint import fingerprint

if TYPE_CHECKING:
    from paretoik.verification.run_contents import Verification


@check_call
def verify(folder: str | Path, problem: Any = None, *, observe: Observer | bool | None = None) -> Verification:
    """Return a row for everything that was checked of a run folder, or was not.

    Files, motions at their samples and between them, limits, collisions, objectives and certificates are checked by
    SciPy and Pinocchio (``pip install "paretoik[verify]"``) against the limits of the problem. No kernel is shared with
    what made the run. ``problem`` is the problem or its name, as for ``load_front``; its numbers and a user's functions
    count. The problem of a polygon is the arm. ``passed`` says whether no check failed, ``unchecked`` what was not
    checked and why, ``verified`` whether nothing is left to belief. ``observe`` learns how many points are checked, as
    that of ``refine`` does.

    Raises
    ------
    InvalidRun
        If the folder is not a run with a result.
    """
    path, reason, same = file_path("folder", folder), "", None
    check_problem_argument(problem)
    from paretoik.verification.arm_model import import_pinocchio
    from paretoik.verification.run_contents import read_contents
    from paretoik.verification.verify_run import verify_run

    with without_writers(path):
        run = read_contents(path)
    problem = named_problem(problem)
    if problem is None:
        reason = f"the run's problem is not at hand: {how_to_name(run.entries.get('problem'))}"
    elif {"objectives", "objective"} & run.entries.keys():
        same = fingerprint(problem) == run.entries.get("fingerprint")
    problem = at_samples_of(problem, run.motions.get("q"))
    try:
        import_pinocchio()
    except InvalidInput as error:  # files and tables are checked without it
        reason, problem = str(error), None
    with open_observer(observe) as observer:
        show = count_observer(observer, "verification", uniform=True)
        return verify_run(run, problem, reason=reason, same=same, show=show)
