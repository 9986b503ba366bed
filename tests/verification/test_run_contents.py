from __future__ import annotations

from paretoik.verification.run_contents import Check, Verification, Worst, demand, judge, leave_out

PLACE = Worst(what="velocity", joint="joint2", time=0.45, value=3.81, limit=3.8, unit="rad/s")


def of(*rows):
    return Verification(folder="runs/a", rows=rows)


def test_verified_is_said_only_if_everything_was_checked_and_passed():
    good = demand("ids", True, "")
    assert of(good, judge("start", 0.0, 1e-9, "")).headline == "runs/a: verified, all 2 checks passed"
    lacking = leave_out("curvature", "no second derivatives", point=3)
    over = Check(subject="limits between samples", deviation=1e-3, tolerance=1e-4, verdict="noted", worst=PLACE)
    failed = judge("velocity limits", 1e-3, 1e-8, str(PLACE), point=3, worst=PLACE)
    for row in (lacking, over, failed):
        assert not of(good, row).verified
        assert "verified" not in repr(of(good, row))
    words = "1 checks passed, 2 not made: curvature of 2 points (no second derivatives)"
    assert of(good, lacking, lacking).headline == f"runs/a: {words}"
    assert of(good, failed).headline == "runs/a: 1 of 2 checks fail"
    place = "velocity of joint2 at 0.45 s: 3.81 rad/s, limit 3.8"
    assert of(good, over).headline.endswith(f"limits exceeded without a promise: limits between samples ({place})")


def test_a_failure_names_point_joint_time_value_and_limit():
    row = judge("velocity limits", 1e-3, 1e-8, f"{PLACE}: exceeded by 0.001 of its range", point=3, worst=PLACE)
    line = "point 3, velocity limits: velocity of joint2 at 0.45 s: 3.81 rad/s, limit 3.8: exceeded by 0.001"
    assert line in repr(of(row))
