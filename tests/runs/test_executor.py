"""A run says who computed it, and whether one process reproduces it bit for bit."""

from __future__ import annotations

import json
from contextlib import closing

from paretoik.runs.distribution import distributing
from paretoik.runs.executor import computed, computed_text
from paretoik.runs.machine import processor
from paretoik.runs.processes import WorkerProcesses

HERE = " ".join(processor())
ALONE = {"by": "this process", "processor": HERE}
WORKERS = {"by": "worker processes", "workers": 3, "processor": HERE}
ELSEWHERE = {"processor": "riscv64 V", "machines": 2, "workers": 8}


def test_who_resumes_a_run_is_listed_after_who_computed_before():
    with closing(WorkerProcesses(3)) as workers, distributing(workers):
        by_workers = computed()
    assert by_workers == {"reproducible": "bit for bit", "by": [WORKERS]}
    both = computed(by_workers)
    assert both == {"reproducible": "bit for bit", "by": [WORKERS, ALONE]}
    assert computed(json.loads(json.dumps(both))) == both  # this process resumes twice and is named once
    assert computed_text(both) == ("worker processes (3), then this process; one process reproduces it bit for bit")


def test_another_make_of_processor_before_or_beside_makes_a_run_reproducible_to_tolerance():
    before = {"by": [{**ALONE, "processor": "riscv64 V"}]}
    assert computed(before)["reproducible"] == "to tolerance"
    mixed = computed({"by": [{"by": "Dask cluster", "processor": HERE, "machines": [ELSEWHERE]}]})
    assert mixed["reproducible"] == "to tolerance"
    assert "8 workers on 2 machines, riscv64 V" in computed_text(mixed)
    assert "reproduces it to tolerance" in computed_text(mixed)


def test_a_cluster_of_which_nothing_came_leaves_unknown_how_a_run_is_reproducible():
    """Its client may have been killed: what its workers computed is in the journal, and they are not."""
    entry = computed({"by": [{"by": "Dask cluster", "processor": HERE, "machines": []}]})
    assert entry["reproducible"] == "unknown"
    assert "unknown" in computed_text(entry)
