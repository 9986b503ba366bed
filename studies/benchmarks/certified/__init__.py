"""Tests of certified fronts: bounds, attempts to dominate, exchange rates, seconds per point."""
