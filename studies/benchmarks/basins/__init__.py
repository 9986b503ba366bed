"""How surely the best optimum is found: problems drawn from seeds, our plan beside multi-starts of IPOPT and FATROP."""
