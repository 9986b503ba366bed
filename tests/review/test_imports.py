from __future__ import annotations

import subprocess
import sys

PROBE = """
import sys
import paretoik.front.storage, paretoik.runs.folder
import paretoik.review.recording.recorder
print(sorted({"rerun", "matplotlib", "pymoo", "pyarrow", "moocore"} & set(sys.modules)))
"""


def test_nothing_heavy_is_imported_before_it_is_used():
    assert subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True).stdout == "[]\n"
