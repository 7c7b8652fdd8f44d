"""How time and memory grow with cells, openings, steps and events."""

DRAWN = ("openings", "steps", "events")  # Cases whose mines and catalogues are drawn by seed.
ARRAYS = "arrays"  # Case, and name of the table, of the arrays that hold the memory.
