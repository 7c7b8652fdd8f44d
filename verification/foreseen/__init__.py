"""What a quote foresees beside what the run takes."""

OPENINGS = ("sphere", "drive_4", "decline", "stope", "turned", "surveyed", "pillar", "filled")
"""mines of study openings, on the cells of standard and fine; the finest ones give the truth"""
MINES = {  # Shipped mines: by case, file below config/mines, and sizes of the finest cells, m.
    "mine_template": ("template", (2.5, 1.25)),
    "mine_demo": ("demo", (4.0, 2.0)),
}
CASES = (*OPENINGS, *MINES)
