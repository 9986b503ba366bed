"""How searches and starts scale over the workers of a cluster, and a model of many more workers."""
