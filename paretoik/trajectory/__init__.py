"""Whole motions as nonlinear programs: transcription, levels and restarts, the grid oracle and its bound."""
