"""The planner beside CasADi + FATROP and CasADi + IPOPT, losses first."""
