"""The folder of a run with its lock, and the signals that interrupt a run. Knows no robot."""
