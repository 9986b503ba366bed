"""The compiled interior-point method.

It contains the protocol of kernels, and a Newton matrix that is banded with a border.
"""
