"""Peak ground velocity at openings from modelled events, and the dynamic demand on support that follows.

Reads datasets, knows no solver. No waveforms are computed.
"""
