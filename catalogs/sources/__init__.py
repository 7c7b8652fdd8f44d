"""Physics and statistics of seismic sources, which records, comparison and report share, and writers of catalogues.

| subject | modules |
|---|---|
| axes of many sources, and angles between them | `mechanisms.py` |
| sizes: b, completeness, which law they follow | `sizes.py`, `completeness.py`, `size_law.py` |
| places: the nearest opening, latitude and longitude | `openings.py`, `geographic_frame.py` |
| intervals by resampling | `jackknife.py` |
| writers: QuakeML, ParaView, a twin of a record | `quakeml.py`, `events_vtk.py`, `twin.py` |
"""
