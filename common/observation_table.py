"""The table of observations, observations.nc: what the model gives where instruments are, beside what they measured."""

import numpy as np

from common.fields import TEXT, Field

ROWS = ("row",)
FIELDS = (
    Field("instrument", ROWS, TEXT, "", "name of the instrument"),
    Field("quantity", ROWS, TEXT, "", "stress or displacement, with its component; extension; closure"),
    Field("distance", ROWS, np.float64, "m", "distance of the point from the start of its line; NaN elsewhere"),
    Field("step", ROWS, TEXT, "", "step at whose end the row holds"),
    Field("unit", ROWS, TEXT, "", "unit of modelled and measured values: MPa or mm"),
    Field("modelled", ROWS, np.float64, "", "value of the model; NaN where there is no rock"),
    Field("modelled_error", ROWS, np.float64, "", "half of its 95 % interval, from the cells"),
    Field("measured", ROWS, np.float64, "", "last reading within the step's dates; NaN without one"),
    Field("measured_error", ROWS, np.float64, "", "standard error of a reading; NaN without one"),
    Field("cell", ROWS, np.float64, "m", "edge of the cell there"),
    Field("failed", ROWS, np.int8, "1", "1 where the rock there has failed; 0 without a cell, too"),
)

MODELLED = Field("modelled", ROWS, np.float64, "", "value of a trial at the row of the readings; NaN without rock")
MODELLED_ERROR = Field("modelled_error", ROWS, np.float64, "", "half of its 95 % interval, from the cells")
READING_FIELDS = (
    *(field for field in FIELDS if field.name in ("instrument", "distance", "step", "unit")),
    Field("measured", ROWS, np.float64, "", "last reading within the step's dates, as read; NaN without one"),
    Field("measured_error", ROWS, np.float64, "", "standard error of a reading; NaN if it is not known"),
    Field("zeroed", ROWS, np.int8, "1", "1 if only changes count, from the step on in which the instrument was zeroed"),
)
"""The table of readings that a calibration uses, readings.nc. A trial has a value for each of its rows."""
