"""The Pareto front: its points and certificates, indicators, preferences and storage."""
