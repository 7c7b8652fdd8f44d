"""Equilibrium of a block with a stope at growing size: our schemes compared with other codes, in one run.

`snakemake benchmarks` runs it by verification/rules/benchmarks.smk; config/benchmarks.yaml lists codes and problems.
"""
