"""How one motion is resolved, deterministic: candidates along the path, self-motion charts, branches."""
