"""Limits between samples: how far motions exceed them there, and the cost of the guarantee."""
