"""The papers' problems and a few real arms, ready to solve; learn here how to write yours."""
