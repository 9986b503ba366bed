"""Every class of wrong values, for every argument of every public name: refused in one good line, or taken with reason.

The cases come from the signatures (``studies.benchmarks.reliability.inputs``), so that a new argument is tried on the
day it is written. By default a part of them is tried; all of them, verbs included, take long.
"""

from __future__ import annotations

import pytest

from studies.benchmarks.reliability.inputs.examples import Examples
from studies.benchmarks.reliability.inputs.judging import cases, judge, make_files, reason
from studies.benchmarks.reliability.inputs.problems import outcomes
from studies.benchmarks.reliability.inputs.surfaces import surfaces

VERBS = ("solve", "plan", "epsilon_front", "refine", "resolve", "directional_maxima", "resume", "verify", "report")
STORED = (*VERBS, "compare", "export", "load_front", "load_plan", "Front.navigate", "Front.refine_around", "Front.view")
SURFACES = {surface.name: surface for surface in surfaces()}
SHARE = 31  # by default one of this many cases is tried


@pytest.fixture(scope="module")
def examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    make_files(folder)
    return Examples(folder)


def verdicts(surface, examples, every):
    wrong = {}
    for case in list(cases([surface]))[::every]:
        outcome = judge(case, examples)
        taken = outcome.verdict == "taken" and (not case.is_certain or reason(case.name))
        if outcome.verdict != "good" and not taken:
            wrong[case.name] = f"{outcome.verdict}: {outcome.words}"
    return wrong


def test_there_are_hundreds_of_bad_inputs_over_every_public_name():
    names = [case.name for case in cases(list(SURFACES.values()))]
    assert len(set(names)) == len(names) >= 400
    assert {name.split(".")[0] for name in SURFACES} >= {"Arm", "Tracking", "solve", "Front", "methods", "obstacles"}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("name", [name for name in SURFACES if name not in STORED])
def test_what_makes_no_sense_is_refused_in_one_line(name, examples, monkeypatch):
    monkeypatch.chdir(examples.folder)
    assert verdicts(SURFACES[name], examples, SHARE) == {}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_problems_that_are_none_are_refused_in_one_line(tmp_path):
    wrong = {
        (surface, name): outcome.words for surface, name, outcome in outcomes(tmp_path) if outcome.verdict != "good"
    }
    assert wrong == {}


@pytest.mark.slow
@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("name", SURFACES)
def test_every_class_of_wrong_values_is_refused_in_one_line(name, examples, monkeypatch):
    monkeypatch.chdir(examples.folder)
    _ = examples.run_folder, examples.plan_folder  # made before anything is judged
    assert verdicts(SURFACES[name], examples, 1) == {}
