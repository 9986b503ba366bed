"""How often the best optimum is found on random problems: our plan against multi-starts of IPOPT and FATROP."""
