"""Runs on disk and who computes them: folders, journal, fingerprint, workers, cluster, signals. Knows no robot."""
