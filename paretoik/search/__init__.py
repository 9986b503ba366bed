"""How fronts are searched: MaxiMin selection, evolution, archive, ask and tell. Knows no robot and no task."""
