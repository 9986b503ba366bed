"""An independent check of run folders. It shares no kernel with the code that it checks."""
