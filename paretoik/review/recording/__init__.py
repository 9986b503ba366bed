"""The content of a run's recording, and the process that records it; the run itself loads no Rerun."""
