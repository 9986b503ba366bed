"""Certified fronts put to the test: bounds, attempts to dominate, exchange rates, seconds a point."""
