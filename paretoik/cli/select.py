"""``paretoik select``: choose one motion of a front by a preference."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from paretoik.api.progress_display import open_observer
from paretoik.api.result_text import choice_text, entries
from paretoik.cli.console import JsonFlag, QuietFlag, RunFolder, exit_code, print_json
from paretoik.errors import InvalidInput


def select(
    run: RunFolder,
    weights: Annotated[str, typer.Option(help="NAME=NUMBER,NAME=NUMBER; what is missing is 0.", show_default=False)],
    picture: Annotated[Path | None, typer.Option(help="Draw the front and the chosen motion into this PNG.")] = None,
    out: Annotated[Path | None, typer.Option(help="Of a closed loop: keep the new run in this folder.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in that folder.")] = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Choose one motion of a front by weights (Marcos et al. 2012, Eqs. 19 and 20).

    A closed loop is followed anew with these weights at every step.
    """
    with redirect_stdout(sys.stderr):
        from paretoik.api.load_front import load_front
        from paretoik.api.select import select as select_point
        from paretoik.front.preferences import Weights

        preference = Weights(parse_weights(weights))
        front = load_front(run)
        with open_observer(not quiet) as observe:
            selected, choice = select_point(front, preference, out=out, overwrite=overwrite, observe=observe or False)
        if picture is not None:
            from paretoik.review.plots import front_picture

            front_picture(selected, picture, choice)
    if as_json:
        print_json({**entries(selected)[choice.index], "reason": choice.reason})
    else:
        print(choice_text(selected, choice))
    if selected is not front:
        raise typer.Exit(exit_code(selected.provenance["status"]))


def parse_weights(text: str) -> dict[str, float]:
    """Return weights by name.

    Raises InvalidInput where a part is not NAME=NUMBER, or a name comes twice.

    >>> parse_weights("kinetic_energy=0.3, torque_norm=0.7")
    {'kinetic_energy': 0.3, 'torque_norm': 0.7}
    """
    weights: dict[str, float] = {}
    for part in text.split(","):
        name, separator, value = part.partition("=")
        name = name.strip()
        if not separator or not name:
            raise InvalidInput(f"weights: wanted NAME=NUMBER,NAME=NUMBER, got {part!r}")
        if name in weights:
            raise InvalidInput(f"weights: wanted each objective once, got {name} twice")
        try:
            weights[name] = float(value)
        except ValueError:
            raise InvalidInput(f"weights: wanted a number for {name}, got {value!r}") from None
    return weights
