"""The review of a run: its recording, pictures, report, and the viewer."""
