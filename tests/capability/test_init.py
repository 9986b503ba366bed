"""The namespace ``pk.capability``: its names are known, load on demand and are documented."""

import inspect
import subprocess
import sys

import pytest

import paretoik as pk

NAMES = [
    "AxesEllipses",
    "DistributedActuation",
    "FastestPath",
    "FitErrors",
    "JointActuation",
    "MotorCurve",
    "PerformancePolygon",
    "PolynomialEllipsoids",
    "SpeedModel",
    "TimeOptimalRun",
    "fastest_path",
    "fit_axes",
    "fit_ellipsoids",
    "fit_errors",
    "kim_joint_motors",
    "kim_sliders",
    "path_time",
    "time_optimal_control",
]


def test_the_names_are_those_listed():
    assert sorted(pk.capability.__all__) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_documented_and_no_module(name):
    named = getattr(pk.capability, name)
    assert inspect.isclass(named) or inspect.isfunction(named)
    assert (named.__doc__ or "").strip()


def test_the_namespace_loads_nothing_heavy():
    heavy = ("pymoo", "cvxpy", "numba", "scipy", "clarabel")
    script = f"import sys, paretoik as pk; pk.capability; print([name for name in {heavy} if name in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
