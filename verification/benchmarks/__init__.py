"""Equilibrium of a block with a stope at growing size: our schemes beside OpenGeoSys and Kratos, in one run.

`snakemake benchmarks` runs it (verification/rules/benchmarks.smk); config/benchmarks.yaml says what.
"""
