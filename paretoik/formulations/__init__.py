"""Formulations: each method as a pymoo problem.

``protocol`` lists the parts that verbs ask for.
"""
