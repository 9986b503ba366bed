"""Files and command lines that nobody would write, led by the coverage of what reads them, and what comes of them."""
