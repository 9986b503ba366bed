"""What a recording shows: scenes, panels, charts and words, drawn with Rerun."""
