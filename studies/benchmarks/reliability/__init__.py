"""Runs that are killed, cut and damaged: what of them is lost, and what they come to when they go on."""
