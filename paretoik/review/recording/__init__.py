"""What is recorded of a run, and the process that records it; the run itself loads no Rerun."""
