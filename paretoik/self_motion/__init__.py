"""The self-motion manifold of a task: postures, starts, charts, curves, branches."""
