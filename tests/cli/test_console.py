from __future__ import annotations

import pytest

from paretoik.cli.console import exit_code


@pytest.mark.parametrize(
    ("status", "code"), [("generations", 0), ("time limit", 5), ("SIGINT", 130), ("interrupted", 130), ("SIGTERM", 143)]
)
def test_what_ended_a_run_is_its_exit_code(status, code):
    assert exit_code(status) == code
