"""Pictures of results as PNG, drawn with Matplotlib and without a screen."""
