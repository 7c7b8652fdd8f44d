"""A mine's configuration as Snakemake has merged it: read, checked, in SI units."""

import os
from pathlib import Path

from common.errors import InputErrors, Mistakes
from workflow.checks import check_mine
from workflow.key_order import key_in, section_of, sorted_by_place
from workflow.mine import Mine
from workflow.mine_settings import MineSettings
from workflow.sound_part import sound_part
from workflow.yaml_habits import with_yaml_habits

MOST_TOLD = 20  # mistakes at once: more scroll away


def load(
    config: dict, mine_file: str | os.PathLike, default: dict | None = None, overrides: dict | None = None
) -> Mine:
    """Check a merged configuration (default and mine) and convert it to SI; `default` is kept for the report.

    overrides: what of it --config says. Raises InputErrors: a line for each mistake, in the order of the file, with the
    file (or --config) and the key.
    """
    mine_file, mistakes = Path(mine_file), Mistakes()
    odd: dict[str, str] = {}
    text = with_yaml_habits(config, odd)
    settings = None
    with mistakes.gather():
        settings = MineSettings.read(text)
    mistakes.lines = [
        *(f"{key}: {reason}" for key, reason in odd.items()),
        *(line for line in mistakes.lines if key_in(line) not in odd),
    ]
    if mistakes.lines:
        text, settings = sound_part(text, map(key_in, mistakes.lines))
    if settings:
        mine = Mine(settings, text, mine_file.parent, default or {})
        check_mine(mine, mistakes, {section_of(line) for line in mistakes.lines})
    if mistakes.lines:
        lines = sorted_by_place(list(dict.fromkeys(mistakes.lines)), mine_file, overrides or {})
        if len(lines) > MOST_TOLD + 1:
            lines[MOST_TOLD:] = [f"{mine_file}: and {len(lines) - MOST_TOLD} more mistakes"]
        raise InputErrors(lines)
    return mine
