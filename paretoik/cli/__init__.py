"""The command line, its sub-commands in chapters. Results go to stdout, progress and errors to stderr."""

from paretoik.cli.app import main as main
