"""The study of random mines: cases of stability whose knob is a stretch of seeds."""

from dataclasses import replace

from verification.page_tables import Counts
from verification.stability.study import MISSES
from verification.stability.study import STUDY as STABILITY

STUDY = replace(STABILITY, shown=(Counts("How random mines end", "series", "kind"), MISSES))
