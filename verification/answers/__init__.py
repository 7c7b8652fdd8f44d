"""One module per study: what is compared, with which exact answer, and one figure of it."""
