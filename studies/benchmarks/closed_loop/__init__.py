"""The compiled search of a control step beside pymoo and pygmo: microseconds a generation, and the same fronts."""
