"""Motions as compiled code takes them."""
