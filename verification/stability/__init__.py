"""Where the numerics stop being trustworthy: one knob at a time to its extremes, each run beside a known truth.

A reduced set runs with the tests; all of it by ``snakemake --cores all stability``.
"""
