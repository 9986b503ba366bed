"""How it is looked at: the recording of a run, pictures, and the viewer."""
