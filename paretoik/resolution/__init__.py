"""One motion locally, step by step: projection methods, predictive minimisation, Nedungadi."""
