"""How work runs: the folder of a run and its lock, and how a run is interrupted. Knows no robot."""
