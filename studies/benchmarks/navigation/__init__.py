"""Random moves along certified fronts, compared with other methods; see ``__main__``."""
