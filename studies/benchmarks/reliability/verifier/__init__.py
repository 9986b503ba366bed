"""Good runs of every kind, faults planted in them, and the number that the verifier catches."""
