"""``paretoik compare``: the fronts of runs side by side, and all of them as one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from paretoik.cli.console import JsonFlag, print_json, print_text, stdout_for_results
from paretoik.runs.files import PICTURE_MARK, check_target


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Folders of finished runs, at least two.", show_default=False)],
    labels: Annotated[
        str | None,
        typer.Option(help="LABEL,LABEL: one per run; equal labels mark runs of one method.", show_default=False),
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the fronts into this PNG.", show_default=False)] = None,
    merge: Annotated[
        Path | None, typer.Option(help="Folder to keep the nondominated points of all runs in.", show_default=False)
    ] = None,
    overwrite: Annotated[
        bool, typer.Option(help="Replace a run in the folder of --merge, or a file that is no picture of ours.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Compare the fronts of runs: hypervolume, coverage, additive epsilon, and the settings that differ."""
    with stdout_for_results():
        from paretoik.api.compare import compare as compare_fronts
        from paretoik.front.comparison import comparison_entries
        from paretoik.runs.folder import check_other_folder, claim_folder

        if picture is not None:
            check_target("picture", picture, overwrite=overwrite, mark=PICTURE_MARK)
        if merge is not None:
            check_other_folder("merge", merge, *runs)
        comparison = compare_fronts(*runs, labels=None if labels is None else labels.split(","))
        if merge is not None:
            merged = comparison.merged
            left_out = merged.provenance["merged"]["left_out"]
            with claim_folder(merge, overwrite=overwrite) as folder:
                merged.save(folder)
        if picture is not None:
            from paretoik.review.pictures.fronts import comparison_picture

            comparison_picture(comparison, picture)
    if as_json:
        merge_entries = {} if merge is None else {"merged": {"out": merge, "points": len(merged), "left_out": left_out}}
        print_json({**comparison_entries(comparison), **merge_entries})
    else:
        print_text(comparison)
        if merge is not None:
            print_text(f"\n{merge}: {len(merged)} points; its run.json says which run each comes from")
            if left_out:
                print_text(f"not every run has the same {' and '.join(left_out)}, so the merged front has none")
