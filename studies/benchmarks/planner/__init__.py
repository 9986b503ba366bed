"""The planner against CasADi + FATROP and CasADi + IPOPT, losses first."""
