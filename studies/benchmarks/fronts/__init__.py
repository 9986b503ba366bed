"""Whole fronts: the gains by MaxiMin, seeding and refinement, and comparisons with peers."""
