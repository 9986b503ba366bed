"""Whole motions as nonlinear programs: transcription, levels, restarts, and the grid oracle with its bound."""
