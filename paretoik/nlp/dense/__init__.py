"""Small dense programs for the interior-point method: traced rows, null space and kernel."""
