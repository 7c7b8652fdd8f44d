"""The figures of the report: each module draws one subject and returns matplotlib figures; style.py says how they look."""
