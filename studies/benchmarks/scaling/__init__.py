"""Scaling of searches and starts over the workers of a cluster, and a model of many more workers."""
