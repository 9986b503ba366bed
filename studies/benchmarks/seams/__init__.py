"""Seams with a free tool axis: whole motions against a ladder graph over tool angles."""
