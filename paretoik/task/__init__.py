"""Motion problems: paths, motions, objectives, limits, and the task."""
