"""Random files and command lines, led by the coverage of their readers, and the outcomes."""
