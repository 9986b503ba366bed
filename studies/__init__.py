"""One study per paper compares its numbers with ours; ``reporting`` is shared, ``benchmarks`` compares with peers."""
