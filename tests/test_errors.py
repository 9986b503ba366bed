"""A warning stands at the user's line that led to it, through any number of our functions."""

from __future__ import annotations

import subprocess
import sys

SCRIPT = """\
import paretoik as pk
arm = pk.arms.tringali_3r()
pk.Limits(position=(-180, 180)).bounds(
    arm, 3)
for limits in [pk.Limits(position={"joint2": 90.0})]:
    print(list(map(limits.bounds, [arm], [3])))
"""


def test_a_warning_names_the_line_of_the_script(tmp_path):
    script = tmp_path / "users_own.py"
    script.write_text(SCRIPT)
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    places = [line.partition(": RuntimeWarning: ")[0] for line in ended.stderr.splitlines() if "RuntimeWarning" in line]
    assert places == [f"{script}:{line}" for line in (3, 6)]
