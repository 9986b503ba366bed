"""Nonlinear programs and their solvers: interior point, SQP, criticality.

Only this package uses cvxpy and Clarabel.
"""
