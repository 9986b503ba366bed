"""Our refinement against other solvers on the same programs."""
