"""The review of a run: its recording, pictures, and the viewer."""
