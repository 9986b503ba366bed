"""Peers side by side; ``studies/README.md`` lists the commands and their figures."""
