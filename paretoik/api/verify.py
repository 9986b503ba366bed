"""Check a run folder a second time, independently of what made it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.api.load import how_to_name, named_problem
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import at_samples_of
from paretoik.inputs import file_path
from paretoik.progress import Observer, count_observer, open_observer
from paretoik.runs.file_replacement import without_writers
from paretoik.runs.fingerprint import fingerprint

if TYPE_CHECKING:
    from paretoik.verification.run_contents import Verification


def verify(folder: str | Path, problem: Any = None, *, observe: Observer | bool | None = None) -> Verification:
    """Check the folder of a run again; return one row per check.

    Parameters
    ----------
    folder
        Folder of a run.
    problem
        Problem or its name, as for ``load_front``; for a polygon the arm. Its numbers and users' functions are used.
    observe
        Observer of the number of points checked, as for ``refine``.

    Returns
    -------
    Verification
        Rows; ``passed``: no check failed; ``unchecked``: checks left out, and why; ``verified``: all passed.

    Raises
    ------
    InvalidRun
        If the folder contains no run with a result.

    Notes
    -----
    SciPy and Pinocchio (``pip install "paretoik[verify]"``) check files, motions at their samples and between them,
    limits, collisions, objectives and certificates, against the limits of the problem. They share no kernel with the
    code that made the run.
    """
    path, reason, same = file_path("folder", folder), "", None
    from paretoik.verification.arm_model import import_pinocchio
    from paretoik.verification.run_contents import read_contents
    from paretoik.verification.verify_run import verify_run

    with without_writers(path):
        run = read_contents(path)
    problem = named_problem(problem)
    if problem is None:
        reason = f"the run's problem is not given: {how_to_name(run.entries.get('problem'))}"
    elif {"objectives", "objective"} & run.entries.keys():
        same = fingerprint(problem) == run.entries.get("fingerprint")
    problem = at_samples_of(problem, run.motions.get("q"))
    try:
        import_pinocchio()
    except InvalidInput as error:  # files and tables are checked without Pinocchio
        reason, problem = str(error), None
    with open_observer(observe) as observer:
        show = count_observer(observer, "verification", uniform=True)
        return verify_run(run, problem, reason=reason, same=same, show=show)
