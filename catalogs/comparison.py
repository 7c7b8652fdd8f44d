"""Modelled events beside recorded ones: where, how large, how oriented, each as a number with an interval.

Layout of comparison.nc
-----------------------
Dimensions: catalogue (model, record), interval (lower, upper: 95 %), xyz, axis (x, y, z of a tensor's second index),
axis_name (P, B, T), pair (see nearest), event_model and event_record (events of catalog.nc and record.nc, in their
order), size_bin, cut, distance, angle, kagan_pair. All but xyz, axis, size_bin and angle carry coordinates.
NaN where a number does not exist (too few events, no tensors, no stable completeness).

Which events
  model_used (event_model), record_used (event_record)   int8: resolved and at or above the cut; model_axes_used,
                                       record_axes_used: and with a tensor or axes. 0 = not in the statistics
  events_total, events_resolved, events_above_cut, events_with_axes (catalogue)   counts
  cut                                  log10 P (m3) used for both catalogues; attribute `cut_is`: "model floor" |
                                       "record completeness" | "smallest recorded event"; `cut_text`: the sentence
  model_floor, record_completeness     log10 P, the two that `cut` is the larger of

Sum of potency (resolved events at or above the cut; _all: every event)
  summed_potency, summed_potency_all (catalogue) m3;  potency_ratio, potency_ratio_all: model / record;
  potency_ratio_interval (interval): blocks resampled

Location
  centroid (catalogue, xyz) m;  centroid_offset (xyz) model - record, centroid_offset_interval (xyz, interval);
  centroid_distance m, centroid_distance_interval
  energy_distance m, energy_distance_interval (interval), energy_distance_null (interval: what one process with the
  same blocks gives by chance: 0.025 and 0.975 quantile), energy_p_value
  nearest_distance (pair) m: median distance from each modelled event to the nearest recorded one, each recorded to the
  nearest modelled, and each recorded to the nearest recorded; nearest_distance_interval (pair, interval)
  distance (distance) m;  cross_k (distance) m3, cross_k_interval (distance, interval): model-record pairs closer than
  distance, as a volume (Ripley); record_k, model_k (distance): the same within each, pairs of one block left out;
  cross_ratio (distance) = cross_k / sqrt(record_k model_k): 1 = as near to each other as to themselves, 0 = apart;
  cross_ratio_interval (distance, interval)
  blocks (catalogue) number of blocks resampled;  attributes location_blocks, location_error, location_text

Size (log10 of potency in m3)
  b, b_error (catalogue), b_interval (catalogue, interval): maximum likelihood, no upper bound; b_magnitude = 1.5 b
  b_truncated, b_truncated_error, b_truncated_interval, largest_log_potency (catalogue): bounded by the largest event
  a (catalogue): log10 N(>= P) = a - b log10 P
  b_difference, b_difference_error, b_difference_interval (interval), b_difference_p_value: model - record
  completeness_curvature, completeness_stability (catalogue): NaN in the second = no stable completeness
  cut_log_potency (cut);  b_by_cut, b_by_cut_error (catalogue, cut), events_by_cut (catalogue, cut)
  size_bin_lower (size_bin), attribute size_bin_width;  incremental, cumulative (catalogue, size_bin): all resolved
  events, not only those above the cut

Axes (attribute axes_text says why they are absent or which events they are of; attribute axes_present 0/1)
  mean_axis (catalogue, axis_name, xyz), mean_trend, mean_plunge (catalogue, axis_name) degrees,
  mean_cone (catalogue, axis_name) degrees: half angle of the 95 % bootstrap cone,
  mean_strength (catalogue, axis_name): largest eigenvalue of the orientation matrix, 1/3 uniform, 1 parallel
  mean_angle (axis_name) degrees between the catalogues' mean axes, mean_angle_interval (axis_name, interval)
  summed_tensor (catalogue, xyz, axis) m3, summed_axis (catalogue, axis_name, xyz), summed_trend, summed_plunge,
  summed_angle (axis_name), summed_kagan: Kagan angle between the two summed tensors. Summed over the record's unit
  tensors where the attribute summed_weight is "unit" (orientations only), over potency tensors where it is "potency"
  kagan_lower (angle) degrees, attribute kagan_bin_width;  kagan_share (kagan_pair, angle): share of pairs per bin for
  model_record, nearest (each modelled event and the nearest recorded), record_record and uniform (random frames);
  kagan_median (kagan_pair), kagan_median_interval (kagan_pair, interval)
  source_share (catalogue, share = iso, clvd, dc): mean of the absolute shares

Attributes: mine, record_kind ("recorded" | "twin"), seed, settings (JSON), size_text, config_hash, source_hash,
versions. The *_text attributes are sentences for the reader of the report.
"""
