"""The part of a configuration that has no mistakes, so that it is checked, too."""

from collections.abc import Iterable

from common.errors import InputError
from workflow.key_order import parts_of
from workflow.mine_settings import MineSettings

ELASTIC = {"model": "elastic", "youngs_modulus": "1 GPa", "poisson_ratio": 0.25, "density": "2000 kg/m^3"}
IN_PLACE = {  # of required keys
    "name": "mine",
    "frame": {"surface": "0 m"},
    "insitu_stress": {"constant": {}},
    "materials": {"host": ELASTIC},
    "plane": "none",
    "ensemble": 0,
}
LISTS = ("excavations", "rock_bodies", "loads", "strains", "steps")


def sound_part(text: dict, keys: Iterable[str]) -> tuple[dict, MineSettings | None]:
    """The configuration without the entries and sections that these keys are in, as text and read; None if that fails.

    A step or a material keeps its name, which others refer to.
    """
    sound = dict(text)
    entries: dict[str, set[int]] = {name: set() for name in LISTS}
    for section, *rest in map(parts_of, keys):
        if section in LISTS and rest and isinstance(rest[0], int) and isinstance(text.get(section), list):
            entries[section].add(rest[0])
        elif section == "materials" and rest and isinstance(text.get(section), dict):
            sound[section] = {
                name: ELASTIC if name.startswith(str(rest[0])) else rock for name, rock in sound[section].items()
            } | {"host": ELASTIC if rest[0] == "host" else sound[section].get("host", ELASTIC)}
        elif section in IN_PLACE:
            sound[section] = IN_PLACE[section]
        else:
            sound.pop(section, None)
    for section, numbers in entries.items():
        if numbers:
            listed = enumerate(text[section])
            kept = [_named(section, entry) if number in numbers else entry for number, entry in listed]
            sound[section] = [entry for entry in kept if entry is not None]
    try:
        return sound, MineSettings.read(sound)
    except InputError:
        return sound, None


def _named(section: str, entry) -> dict | None:
    """What remains of a wrong entry."""
    is_named = section == "steps" and isinstance(entry, dict) and isinstance(entry.get("name"), str)
    return {"name": entry["name"]} if is_named else None
