"""What is asked: path, timing, motion, objectives, limits, obstacles, and the task they make."""
