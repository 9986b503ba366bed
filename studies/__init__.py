"""One study a paper, its numbers beside ours; ``reporting`` is what they share, ``benchmarks`` our peers."""
