"""The compiled search of a control step against pymoo and pygmo: microseconds per generation, and equal fronts."""
