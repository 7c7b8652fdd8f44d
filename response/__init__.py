"""What drives and stopes feel and what instruments see: failed rock, closure and stress at walls and points.

It reads grid, states and catalogues as files, and knows no solver.
"""
