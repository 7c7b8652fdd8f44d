"""Closed forms that the scenes are compared with: pure functions, SI units, tension positive, each with its source."""
