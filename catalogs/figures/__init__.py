"""The figures of the report: each module draws one subject, style.py says how all look."""
