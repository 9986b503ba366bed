"""Evolutionary search of fronts: MaxiMin selection, archive, ask and tell; independent of robots and tasks."""
