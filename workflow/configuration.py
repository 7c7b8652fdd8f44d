"""A mine's configuration as Snakemake has merged it: read, checked, in SI units."""

import os
from pathlib import Path

from pipeline.errors import InputError
from workflow.accuracy import apply_accuracy
from workflow.checks import check_mine
from workflow.far_field import complete
from workflow.mine import Mine
from workflow.settings import MineSettings
from workflow.yaml_habits import with_yaml_habits


def load(config: dict, mine_file: str | os.PathLike, default: dict | None = None) -> Mine:
    """Check a merged configuration (default and mine) and convert it to SI; `default` is kept for the report.

    Raises InputError, one line, naming the file and the key.
    """
    mine_file = Path(mine_file)
    try:
        text = with_yaml_habits(config)
        mine = Mine(MineSettings.read(text).given(), text, mine_file.parent, default or {})
        complete(mine)
        apply_accuracy(mine)
        check_mine(mine)
    except InputError as error:
        raise InputError(f"{mine_file}: {error}") from error
    return mine
