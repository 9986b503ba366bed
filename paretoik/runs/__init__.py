"""Runs on disk, and the processes that compute them. Knows no robot.

Folders, journal, fingerprint, workers, cluster and signals.
"""
