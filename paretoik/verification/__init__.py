"""An independent second opinion on what a run folder holds: nothing here shares a kernel with what it checks."""
