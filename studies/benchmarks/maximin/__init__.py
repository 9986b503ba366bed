"""MaxiMin against pymoo's algorithms on test problems, at equal evaluations."""
