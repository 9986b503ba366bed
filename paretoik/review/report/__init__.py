"""The report of a front: one page of HTML."""
