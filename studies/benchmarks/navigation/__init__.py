"""Random moves along certified fronts, held against what others find; see ``__main__``."""
