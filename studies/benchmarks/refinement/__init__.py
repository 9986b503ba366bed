"""Our refinement beside other solvers on the same programs."""
