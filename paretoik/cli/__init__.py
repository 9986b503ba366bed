"""The command line: a group of sub-commands per file.

Results go to stdout, progress and errors to stderr.
"""

from paretoik.cli.app import main as main
