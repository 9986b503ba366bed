"""What an arm can do (Kim, Choi & Jang 2021): actuation, directional maxima, speed models, time-optimal control."""
