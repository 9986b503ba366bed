"""What a problem is, as a digest: of its values, and of the source of the code that a user wrote."""
