"""Equilibrium of a block with a stope at growing size: our schemes compared with other codes, in one run.

`snakemake benchmarks` runs it; config/benchmarks.yaml lists codes and problems.
"""
