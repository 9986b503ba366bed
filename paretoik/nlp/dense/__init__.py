"""Small dense programs for the interior point method: traced rows, the null space, and the kernel."""
