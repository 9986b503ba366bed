"""What is said of a directional maximum beside its pictures, in Markdown."""

from __future__ import annotations

import numpy as np

from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing_options import DRAWING
from paretoik.review.recording.measured_maxima import MaximaEnd, MaximaScene
from paretoik.review.run_words import run_text


def maximum_text(scene: MaximaScene, end: MaximaEnd, number: int) -> str:
    """Return what is to be known of the maximum along a direction, by its number from 1."""
    row, arm = number - 1, scene.workcell.arm
    value, direction = end.values[row], end.directions[row]
    lines = [
        f"# Direction {number} of {len(end)}",
        f"- along ({', '.join(f'{_without_dust(each, direction):.3g}' for each in direction)})",
    ]
    if len(direction) == 2:
        lines[-1] += f", {np.degrees(np.arctan2(direction[1], direction[0])) % 360:.4g}° from x"
    if not np.isfinite(value):
        return screen_text("\n".join([*lines, "- no posture was found that reaches it and can be held"]))
    best, worst = int(np.nanargmax(end.values)), int(np.nanargmin(end.values))
    lines += [
        f"- highest {scene.word} {value:.4g} {scene.unit}; of all directions {end.values[worst]:.4g} (direction "
        f"{worst + 1}) to {end.values[best]:.4g} (direction {best + 1})",
        "",
        "## Joints",
        "",
    ]
    for joint, (name, kind) in enumerate(zip(arm.joint_names, arm.joint_types, strict=True)):
        position, speed, effort = ("m", "m/s", "N") if kind == "prismatic" else ("rad", "rad/s", "N m")
        torque = _without_dust(end.torque[row, joint], end.torque)
        words = f"- **{name}**: {end.q[row, joint]:.4g} {position}, {'force' if kind == 'prismatic' else 'torque'} "
        words += f"{torque:.3g} {effort}"
        unit = speed if scene.quantity == "velocity" else effort
        if scene.quantity == "velocity":
            words += f", {_without_dust(end.dq[row, joint], end.dq):.4g} {speed}"
        low, high = end.lower[row, joint], end.upper[row, joint]
        lines.append(f"{words}; motors allow {low:.3g} to {high:.3g} {unit}")
    if end.sliders is not None:
        lines += ["", "## Sliders", ""]
        lines += [
            f"- **{name}**: its front slider at {1e3 * end.sliders[row, 0, joint]:.4g} mm, its back slider at "
            f"{1e3 * end.sliders[row, 1, joint]:.4g} mm"
            for joint, name in enumerate(arm.joint_names)
        ]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _without_dust(value: float, all_values: np.ndarray) -> float:
    """Return a value, 0 where it is but rounding beside the largest of all."""
    return 0.0 if abs(value) <= DRAWING.rounding * float(np.nanmax(np.abs(all_values))) else float(value)
