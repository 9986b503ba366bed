"""The command line, one file a sub-command. Results go to stdout, progress and errors to stderr."""

from paretoik.cli.app import main as main
