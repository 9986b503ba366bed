"""The content of a recording: scenes, panels, charts and words, drawn with Rerun."""
