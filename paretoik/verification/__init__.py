"""An independent second opinion on the contents of a run folder: no kernel is shared with the code that it checks."""
