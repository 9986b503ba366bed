"""Seams with a free tool axis: whole motions beside a ladder graph over tool angles."""
