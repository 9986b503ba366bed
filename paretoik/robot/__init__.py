"""What moves: arms, their kinematics and dynamics, and where their descriptions come from."""
