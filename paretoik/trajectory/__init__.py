"""Motions as nonlinear programs: transcription, levels, restarts, and the grid oracle."""
