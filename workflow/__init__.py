"""The workflow: configuration, rules, profiles. Points to mpm_core, seismic and catalogs; none of them points back."""

import logging
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
# The folder of config, profiles and the Snakefile: the checkout, or in an installation this package.
BASE = PACKAGE if (PACKAGE / "config").is_dir() else PACKAGE.parent

# Reading a solid may log. Without a handler logging.info() would give the root logger one that writes to the terminal,
# and Snakemake's own records, which reach the root logger too, would all appear there. Stages replace this handler by
# their own (common.stage).
logging.getLogger().addHandler(logging.NullHandler())
