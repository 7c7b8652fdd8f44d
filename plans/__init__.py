"""Mining plans of one mine side by side: what each makes, how much they differ, and the chance of a large event.

The package reads grids, states, events and a record. It knows no solver and reads no configuration.
"""
