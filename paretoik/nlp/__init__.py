"""Nonlinear programs and their solvers: interior point, SQP, criticality. The only home of cvxpy and Clarabel."""
