"""The packages of the pipeline; all else about them is in pyproject.toml."""

from setuptools import find_packages, setup

# The defaults, the shipped mines and the profiles stand beside the packages here, and within `workflow` when installed.
DATA = {"workflow.config": "config", "workflow.profiles": "profiles"}
ENDINGS = ("smk", "yaml", "rst", "j2", "js", "css", "txt", "csv", "dxf", "obj", "LICENSE")

setup(
    packages=[*find_packages(exclude=["tests*", "docs*"]), *DATA],
    package_dir=DATA,
    package_data={"": [f"**/{name}" for name in ("Snakefile", *(f"*.{ending}" for ending in ENDINGS))]},
)
