"""Notice of the results that a run makes again, before it starts: which jobs, since which keys changed, how long."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from common.costs import cost_of, duration_text

CONFIG = "config"  # setting of the report's job: the mine file as written, whose keys a user knows
AS_MADE = {
    "default",
    "insitu",
    "foreseen",
}  # settings of that job which only follow from the mine file, or from the program
WRITTEN, SETTING, OTHER = "written", "setting", "other"
MAX_CHANGES_SHOWN = 3
ORDINARY = {"report_page"}  # a link, which says nothing to the user


@dataclass(frozen=True)
class RepeatedJob:
    """A job that is about to run: its rule, the file that describes it, its first output, its log and its threads."""

    rule: str
    description: Path
    output: Path
    log: Path
    threads: int

    @property
    def seconds(self) -> float:
        """Wall time of its last run without compiling, s; 0 where no log tells it."""
        costs = cost_of(self.log)
        return costs.next_seconds if costs else 0.0

    def changes(self) -> Iterator[tuple[str, str]]:
        """What differs from the earlier form of its description, each with its kind: WRITTEN, a key of the mine file;
        SETTING, a key of a stage; OTHER, a file of the user or the program."""
        earlier = [path for path in self.description.parent.glob("*.json") if path.name != self.description.name]
        if not earlier:
            return
        try:
            latest = max(earlier, key=lambda path: path.stat().st_mtime)
            before, now = (json.loads(path.read_text(encoding="utf-8")) for path in (latest, self.description))
            old, new = before["settings"], now["settings"]
        except (OSError, ValueError, KeyError, TypeError):  # of another version: it tells no reason
            return
        if CONFIG in new:
            yield from ((WRITTEN, key) for key in different(old.get(CONFIG), new[CONFIG]))
            old, new = (
                {key: value for key, value in one.items() if key not in {CONFIG, *AS_MADE}} for one in (old, new)
            )
        yield from ((SETTING, key) for key in different(old, new))
        files = now.get("files", {})
        yield from ((OTHER, name) for name in files if before.get("files", {}).get(name, files[name]) != files[name])
        if before.get("code") != now.get("code"):
            yield OTHER, "the program"


def different(before: object, now: object, path: str = "") -> Iterator[str]:
    """Keys of nested settings in which two differ: materials.host.cohesion. A list is one key."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*before, *(key for key in now if key not in before)]:
            yield from different(before.get(key), now.get(key), f"{path}.{key}" if path else str(key))
    elif before != now:
        yield path


def notice(jobs: Sequence[RepeatedJob], cores: int) -> str:
    """The lines that say what runs again, how long it took and why; empty if no result is replaced.

    cores: those of the run. A job of few threads takes its share of them.
    """
    again = [job for job in jobs if job.output.exists() and job.rule not in ORDINARY]
    if not again:
        return ""
    rules = Counter(job.rule for job in again)
    named = ", ".join(f"{rule} ({count})" if count > 1 else rule for rule, count in rules.items())
    seconds = sum(job.seconds * min(job.threads, cores) / cores for job in again)
    text = f"runs again, and replaces results: {named}"
    text += f"; about {duration_text(seconds)}, by the times of the last run" if seconds else ""
    changes = _named(change for job in again for change in job.changes())
    return text + (f"\nbecause of changes: {changes}" if changes else "")


def _named(changes: Iterable[tuple[str, str]]) -> str:
    """The first changes: keys of the mine file, or of stages where no job holds that file; then all else."""
    found = {kind: dict[str, None]() for kind in (WRITTEN, SETTING, OTHER)}
    for kind, name in changes:
        found[kind][name] = None
    names = [*(found[WRITTEN] or found[SETTING]), *found[OTHER]]
    more = f" and {len(names) - MAX_CHANGES_SHOWN} more" if len(names) > MAX_CHANGES_SHOWN else ""
    return ", ".join(names[:MAX_CHANGES_SHOWN]) + more
