"""Whole fronts: what MaxiMin, seeding and refinement each add, and our fronts beside our peers'."""
