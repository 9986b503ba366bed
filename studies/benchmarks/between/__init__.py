"""Limits between samples: how far motions exceed them there, and what the guarantee costs."""
