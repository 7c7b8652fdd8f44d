"""What a quote foresees beside what the run takes."""

OPENINGS = ("sphere", "drive_4", "decline", "stope", "turned", "surveyed", "pillar", "filled")
"""mines of study openings, on the cells of standard and fine; the finest ones give the truth"""
MINES = {  # Shipped mines: by case, file below config/mines, and sizes of the finest cells, m.
    "mine_template": ("template", (2.5, 1.25)),
    "mine_demo": ("demo", (4.0, 2.0)),
    "mine_elk_creek": ("elk_creek", (20.0,)),
    "mine_renison_scale": ("renison_scale", (5.0, 2.5)),
}
SECTION = "section"
"""the long stope of study economies in plane strain, in case SECTION, and the sizes of its finest cells, m"""
SECTION_SIZES = (0.25, 0.125)
CASES = (*OPENINGS, SECTION, *MINES)
REQUESTS = "foreseen_requests"
"""the study whose mines are run on the cells that a request asks for, each a case of its own"""
