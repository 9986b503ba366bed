"""The verbs of the public interface, one file each."""
