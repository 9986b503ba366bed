"""Bad inputs made by rules for every argument of every public name, and their outcomes."""
