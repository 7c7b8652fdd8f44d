"""The location error that a QuakeML origin states."""

import numpy as np
from obspy.core.event import Origin

from catalogs.distributions import chi_square_quantile

METRES_PER_DEGREE = 111_195.0  # Length of a degree of latitude: 6,371 km times pi / 180.
ONE_SIGMA_PERCENT = 68.27  # Confidence level of an uncertainty that states none: it is a standard error.


def location_uncertainty(origin: Origin | None, depth_unit: float = 1.0) -> float:
    """Root mean square location error in 3-D, m; NaN unless the origin states it across and in depth.

    depth_unit: of depths and their uncertainty, m.

    From the confidence ellipsoid, else from the uncertainties of latitude, longitude and depth, else from horizontal
    uncertainty (circle or ellipse) and that of depth. A confidence level (%) makes a standard error of each (normal
    errors, chi-square of as many degrees of freedom as the region has dimensions).
    """
    if origin is None:
        return np.nan
    region, depth = origin.origin_uncertainty, depth_unit * _standard_error(origin.depth_errors)
    if region is not None and region.confidence_ellipsoid is not None:
        body = region.confidence_ellipsoid
        axes = (body.semi_major_axis_length, body.semi_intermediate_axis_length, body.semi_minor_axis_length)
        if all(axis is not None for axis in axes):
            return float(np.sqrt(np.sum(np.square(axes, dtype=float)))) / sigmas(region.confidence_level, 3)
    north, east = _standard_error(origin.latitude_errors), _standard_error(origin.longitude_errors)
    across = METRES_PER_DEGREE * np.hypot(north, east * np.cos(np.radians(origin.latitude or 0.0)))
    if not np.isfinite(across) and region is not None:
        both = (region.max_horizontal_uncertainty, region.min_horizontal_uncertainty)
        if None in both:
            both = (region.horizontal_uncertainty,) * 2
        across = np.nan if None in both else np.hypot(*both) / sigmas(region.confidence_level, 2)
    error = float(np.hypot(across, depth))
    return error if error > 0 else np.nan


def _standard_error(errors) -> float:
    """Of one coordinate; NaN if it has none."""
    if not errors or errors.uncertainty is None:
        return np.nan
    return float(errors.uncertainty) / sigmas(errors.confidence_level, 1)


def sigmas(level: float | None, dimensions: int) -> float:
    """How many standard errors of one coordinate the edge of a confidence region is away."""
    share = (ONE_SIGMA_PERCENT if level is None or not 0 < level < 100 else level) / 100
    return float(np.sqrt(chi_square_quantile(share, dimensions)))
