"""Where they meet: each method as a pymoo problem, one method a file."""
