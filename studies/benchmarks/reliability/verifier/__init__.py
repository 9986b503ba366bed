"""Good runs of every kind, faults planted in them, and how many of them the verifier catches."""
