"""What comes out: the front, how good it is, what a user prefers of it, and how it is kept."""
