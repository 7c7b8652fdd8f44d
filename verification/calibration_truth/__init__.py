"""A calibration on known truth: trials as records, twins, records of other laws, and an independent sampler."""
