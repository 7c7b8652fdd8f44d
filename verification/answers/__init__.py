"""The studies with a known answer. Each module or package has a function `answer`, and TABLES of its page if any.

`answer(results)` takes verification.results.Results and returns the rows of the comparison and a figure. TABLES is a
tuple of verification.page_tables.Pivot. A study file of config/verification names its module under `answer`.
"""
