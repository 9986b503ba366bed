"""The papers' problems and a few real arms, ready to solve; examples of how to write yours."""
