"""The report of a mine: page.py composes it, inputs.py reads what it is made from, the others are its parts."""
