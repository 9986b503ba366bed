"""Compiled kernels: what actuators let a joint do, and the directional maxima of planar arms."""
