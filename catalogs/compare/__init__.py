"""Two catalogues against each other, runs of an ensemble, runs on two cell sizes: numbers with intervals."""
