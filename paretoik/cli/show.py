"""``paretoik show``: open the recording of a run."""

from __future__ import annotations

from paretoik.cli.arguments import RunFolder


def show(run: RunFolder) -> None:
    """Open the recording of a run in the Rerun viewer."""
    from paretoik.review.viewer import show as open_viewer

    open_viewer(run)
