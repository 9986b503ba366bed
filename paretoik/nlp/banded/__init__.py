"""The compiled interior-point method: the protocol of kernels and a Newton matrix that is banded with a border."""
