"""The interior point method, compiled: one protocol of kernels, and a Newton matrix that is banded with a border."""
