"""Layout of comparison.nc: every variable with its dimensions, unit and meaning, in one table.

Dimensions: catalogue (model, record), interval (lower, upper: 95 %), xyz, axis (x, y, z of a tensor's second index),
axis_name (P, B, T), pair (of nearest_distance), share (iso, clvd, dc), event_model and event_record (events of
catalog.nc and record.nc, in their order), size_bin, trial_cut, distance, angle, eigenvalue, kagan_pair. All but xyz,
axis, event_model, event_record, size_bin, trial_cut, angle and eigenvalue carry coordinates. A mine that gives a face
has FACE_FIELDS, too, with face_axis (ahead, across), weight (number, potency), measure, and without coordinates
event_face_model and event_face_record (events with a place against the face). Places and axes of the model are those
of all its runs, if it has an ensemble. NaN where a number does not exist (too few events, no tensors,
no stable completeness), and for intervals and p-values of places and axes if the model ran fewer than three times: all
but those of the centroid, the energy distance and the mechanism's turn, which then take the model's events to be as
clustered as the record's.

Attributes: mine, record_kind ("recorded" | "twin"), period_model, period_record, settings (JSON, defaults filled in),
cut_is ("model floor" | "record completeness" | "smallest recorded" | "nothing"), cut_stable (1: b of the record is
stable), law_model, law_record ("power law" | "truncated power law" | "no power law" | "too few events": what sizes
above the cut follow), location_error (m, median of the events compared),
axes_present (0 | 1), summed_weight ("unit": over unit tensors where the record has orientations only | "potency"),
size_bin_width, kagan_bin_width (degrees), and those of a job's provenance (common.job). period_text, cut_text,
sums_text, size_text, location_text and axes_text are sentences for the reader of the report; they also say why a number
does not exist.
"""

import numpy as np
import numpy.typing as npt
import xarray as xr

from common.fields import TEXT, Field

DEGREE = "degree"
CATALOGUES = ("model", "record")  # coordinate `catalogue`
LOG_M3 = "log10(m3)"  # logarithms of potency in m3


def _field(name: str, dims: str, unit: str, meaning: str, dtype: npt.DTypeLike = np.float64) -> Field:
    return Field(name, tuple(dims.split()), dtype, unit, meaning)


FIELDS = (
    # which events count
    _field("model_used", "event_model", "1", "1: resolved and at or above the cut; 0: not in the statistics", np.int8),
    _field("record_used", "event_record", "1", "1: at or above the cut; 0: not in the statistics", np.int8),
    _field("model_axes_used", "event_model", "1", "1: in the statistics, and with a tensor", np.int8),
    _field("record_axes_used", "event_record", "1", "1: in the statistics, and with a tensor", np.int8),
    _field("events_total", "catalogue", "1", "events of the catalogue", np.int64),
    _field("events_resolved", "catalogue", "1", "of enough particles (all of a record) in the time compared", np.int64),
    _field("events_above_cut", "catalogue", "1", "of these at or above the cut: the events compared", np.int64),
    _field("events_with_axes", "catalogue", "1", "events whose axes are compared", np.int64),
    _field("blocks", "catalogue", "1", "what is resampled: runs of the model, clusters of recorded events", np.int64),
    _field("cut", "", LOG_M3, "smallest size that counts in both catalogues: the larger of the next two"),
    _field("model_floor", "", LOG_M3, "smallest size that the model's cells resolve"),
    _field("record_completeness", "", LOG_M3,
           "size from which the record is complete (stable b, else the fullest bin)"),
    # sums of potency
    _field("exposure", "", "d", "time compared: of the dated steps, what both catalogues are known for"),
    _field("event_rate", "catalogue", "1/d", "events compared per day of exposure"),
    _field("event_rate_interval", "interval", "1/d", "95 % interval of the number expected of the record, per day"),
    _field("potency_rate", "catalogue", "m3/d", "potency of the events compared per day of exposure"),
    _field("potency_rate_interval", "interval", "m3/d", "that of its potency, of events up to the largest recorded"),
    _field("dispersion_index", "", "1", "variance of the record's number of events over its mean; 1: independent"),
    _field("model_runs", "", "1", "runs of the model whose mean the next ratios take", np.int64),
    _field("event_ratio", "", "1", "number of events compared, model over record"),
    _field("event_ratio_interval", "interval", "1", "95 % interval of that of those expected; may be open above"),
    _field("event_ratio_p_value", "", "1", "chance of a ratio as far from 1 if both expect as many events"),
    _field("event_ratio_noticed", "", "1", "ratio of those expected that its test notices in 4 of 5 cases"),
    _field("summed_potency", "catalogue", "m3", "potency of the events compared"),
    _field("summed_potency_all", "catalogue", "m3", "potency of every event"),
    _field("potency_ratio", "", "1", "summed potency, model over record"),
    _field("potency_ratio_all", "", "1", "potency of every event, model over record"),
    _field("potency_ratio_interval", "interval", "1", "95 % interval of that of those expected; may be open above"),
    _field("potency_ratio_p_value", "", "1", "chance of a ratio as far from 1 if both expect as much potency"),
    _field("potency_ratio_noticed", "", "1", "ratio of those expected that its test notices in 4 of 5 cases"),
    _field("large_events", "catalogue", "1", "largest events that hold 90 % of the potency, of all runs", np.int64),
    _field("potency_ratio_without_large", "catalogue", "1", "potency_ratio without these events of this catalogue"),
    # location
    _field("centroid", "catalogue xyz", "m", "mean location of the events compared"),
    _field("centroid_offset", "xyz", "m", "centroid of the model minus that of the record"),
    _field("centroid_offset_interval", "xyz interval", "m", "its 95 % interval"),
    _field("centroid_distance", "", "m", "distance between the centroids"),
    _field("centroid_distance_interval", "interval", "m", "its 95 % interval"),
    _field("energy_distance", "", "m", "energy distance of the locations (Szekely and Rizzo 2013); 0: alike"),
    _field("energy_distance_interval", "interval", "m", "its 95 % interval"),
    _field("energy_distance_null", "interval", "m", "0.025 and 0.975 quantile of what one process gives by chance"),
    _field("energy_p_value", "", "1", "chance of as large an energy distance if both are one process"),
    _field("shift_noticed", "", "m", "shift of the centroid that the test notices in 4 of 5 cases"),
    _field("nearest_distance", "pair", "m", "median distance from an event to the nearest of the other catalogue"),
    _field("nearest_distance_interval", "pair interval", "m", "its 95 % interval"),
    _field("distance", "distance", "m", "distances of the next six"),
    _field("cross_k", "distance", "m3", "model-record pairs closer than distance, as a volume (Ripley)"),
    _field("cross_k_interval", "distance interval", "m3", "its 95 % interval"),
    _field("model_k", "distance", "m3", "the same within the model, pairs of one block left out"),
    _field("record_k", "distance", "m3", "the same within the record, pairs of one block left out"),
    _field("cross_ratio", "distance", "1", "cross_k / sqrt(record_k model_k); 1: as near as to their own, 0: apart"),
    _field("cross_ratio_interval", "distance interval", "1", "its 95 % interval"),
    # sizes: N(>= P) = 10^a P^-b
    _field("b", "catalogue", "1", "b of potency, maximum likelihood without an upper bound; of magnitudes it is 1.5 b"),
    _field("b_error", "catalogue", "1", "its standard error"),
    _field("b_interval", "catalogue interval", "1", "its 95 % interval; of a power law with b_truncated's"),
    _field("b_magnitude", "catalogue", "1", "b of moment magnitudes: 1.5 b of potency"),
    _field("a", "catalogue", "1", "a in log10 N(>= P) = a - b log10 P, P in m3"),
    _field("b_truncated", "catalogue", "1", "b if no event may be larger than the largest"),
    _field("b_truncated_error", "catalogue", "1", "its standard error"),
    _field("b_truncated_interval", "catalogue interval", "1", "its 95 % interval"),
    _field("largest_log_potency", "catalogue", LOG_M3, "largest event"),
    _field("b_difference", "", "1", "b of the model minus that of the record, both truncated if either law is"),
    _field("b_difference_error", "", "1", "its standard error"),
    _field("b_difference_interval", "interval", "1", "its 95 % interval"),
    _field("b_difference_p_value", "", "1", "chance of as large a difference if both follow one law"),
    _field("b_difference_noticed", "", "1", "difference of b that the test notices in 4 of 5 cases"),
    _field("completeness_curvature", "catalogue", LOG_M3, "lower edge of the fullest bin"),
    _field("power_law_p_value", "catalogue", "1", "chance of so bad a fit if sizes follow a power law (bootstrap)"),
    _field("truncated_law_p_value", "catalogue", "1", "the same of a power law that ends at the largest event"),
    _field("size_rounding", "catalogue", LOG_M3, "width of the bins that sizes are rounded to; 0: they are not"),
    _field("completeness_stability", "catalogue", LOG_M3, "size from which b is stable, and a margin; NaN: none"),
    _field("cut_log_potency", "trial_cut", LOG_M3, "cuts of the next three"),
    _field("b_by_cut", "catalogue trial_cut", "1", "b of potency of the events at or above each cut"),
    _field("b_by_cut_error", "catalogue trial_cut", "1", "its standard error"),
    _field("events_by_cut", "catalogue trial_cut", "1", "events at or above each cut", np.int64),
    _field("size_bin_lower", "size_bin", LOG_M3, "lower edges of the bins of the next two"),
    _field("incremental", "catalogue size_bin", "1", "resolved events per bin, those below the cut too", np.int64),
    _field("cumulative", "catalogue size_bin", "1", "resolved events at or above the bin's lower edge", np.int64),
    # axes
    _field("mean_axis", "catalogue axis_name xyz", "1", "mean axis: unit eigenvector of the orientation matrix"),
    _field("mean_trend", "catalogue axis_name", DEGREE, "its trend, clockwise from north"),
    _field("mean_plunge", "catalogue axis_name", DEGREE, "its plunge below the horizontal"),
    _field("mean_cone", "catalogue axis_name", DEGREE, "half angle of its 95 % cone; NaN of a model that ran once"),
    _field("axis_eigenvalue", "catalogue axis_name eigenvalue", "1", "of the orientation matrix, the largest first"),
    _field("axis_k", "catalogue axis_name", "1", "Woodcock's K: above 1 more of a cluster, below 1 more of a girdle"),
    _field("axis_shape", "catalogue axis_name", "", "cluster, girdle or no preferred direction; empty: no axes", TEXT),
    _field("pole_trend", "catalogue axis_name", DEGREE, "trend of a girdle's pole, clockwise from north"),
    _field("pole_plunge", "catalogue axis_name", DEGREE, "plunge of a girdle's pole below the horizontal"),
    _field("axis_clear_share", "catalogue axis_name", "1", "share of the potency whose axis is clear, and counted"),
    _field("mean_angle", "axis_name", DEGREE, "angle between the catalogues' mean axes"),
    _field("mean_angle_interval", "axis_name interval", DEGREE, "its 95 % interval; from 0 if they may be one"),
    _field("mean_angle_p_value", "axis_name", "1", "chance of as large an angle if the mean axes are one"),
    _field("summed_tensor", "catalogue xyz axis", "m3", "sum of potency tensors, or of unit tensors (summed_weight)"),
    _field("summed_axis", "catalogue axis_name xyz", "1", "principal axes of the summed tensor, unit vectors"),
    _field("summed_trend", "catalogue axis_name", DEGREE, "their trend, clockwise from north"),
    _field("summed_plunge", "catalogue axis_name", DEGREE, "their plunge below the horizontal"),
    _field("summed_angle", "axis_name", DEGREE, "angle between the axes of the two summed tensors"),
    _field("summed_kagan", "", DEGREE, "Kagan angle between the two summed tensors"),
    _field("mechanism_turn", "", DEGREE, "least turn between the mean mechanisms, each event counted once"),
    _field("mechanism_turn_interval", "interval", DEGREE, "its 95 % interval; from 0 if they may be one"),
    _field("mechanism_turn_p_value", "", "1", "chance of as large a turn if the mean mechanisms are one"),
    _field("mechanism_turn_random_p_value", "", "1", "chance of as small a turn between random mechanisms"),
    _field("mechanism_turn_noticed", "", DEGREE, "turn that the test notices in 4 of 5 cases"),
    _field("kagan_lower", "angle", DEGREE, "lower edges of the bins of Kagan angles"),
    _field("kagan_share", "kagan_pair angle", "1", "share of the pairs per bin"),
    _field("kagan_median", "kagan_pair", DEGREE, "median Kagan angle of the pairs"),
    _field("kagan_median_interval", "kagan_pair interval", DEGREE, "its 95 % interval"),
    _field("source_share", "catalogue share", "1", "mean of the absolute isotropic, CLVD and double-couple shares"),
    # coordinates
    _field("catalogue", "catalogue", "", "which of the two catalogues", TEXT),
    _field("interval", "interval", "", "lower and upper end of a 95 % interval", TEXT),
    _field("axis_name", "axis_name", "", "P: most compressive, B: intermediate, T: most tensile axis", TEXT),
    _field("pair", "pair", "", "from which catalogue's events to the nearest of which", TEXT),
    _field("share", "share", "", "isotropic, compensated linear vector dipole, double couple", TEXT),
    _field(
        "kagan_pair", "kagan_pair", "", "which pairs: all model with record, nearest, within the record, random", TEXT
    ),
)  # fmt: skip

# of a mine that gives a face: places of the events against it
FACE_FIELDS = (
    _field("face_measure", "catalogue weight measure", "", "medians and half width (m) and share (1) of places against "
           "the face at the end of each event's step"),
    _field("face_measure_interval", "catalogue weight measure interval", "", "its 95 % interval"),
    _field("face_events", "catalogue", "1", "events compared, of all runs, in whose step a face stands", np.int64),
    _field("model_face", "event_face_model face_axis", "m", "place of a modelled event against the face, with the "
           "record's location error and a uniform share"),
    _field("record_face", "event_face_record face_axis", "m", "place of a recorded event against the face"),
    _field("model_face_weight", "event_face_model weight", "1", "share of each in all of them"),
    _field("record_face_weight", "event_face_record weight", "1", "share of each in all of them"),
    _field("face_axis", "face_axis", "", "ahead of the face, and across from its middle", TEXT),
    _field("weight", "weight", "", "whether each event counts the same, or by its potency", TEXT),
    _field("measure", "measure", "", "what is measured of the places", TEXT),
)  # fmt: skip


def described(dataset: xr.Dataset) -> xr.Dataset:
    """The comparison with unit and meaning on every variable.

    Raises ValueError for one that is not in the table, InputError for one of another type or of other dimensions.
    """
    fields = {field.name: field for field in (*FIELDS, *FACE_FIELDS)}
    for name, variable in dataset.variables.items():
        if name not in fields:
            raise ValueError(f"comparison: {name} is not in the layout")
        variable.attrs = fields[name].attributes
        fields[name].check(dataset, "comparison")
    if dataset.attrs.get("summed_weight") == "unit":
        dataset["summed_tensor"].attrs["units"] = "1"
    return dataset
