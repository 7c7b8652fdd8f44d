"""The report of a mine: page.py composes it, evidence.py reads what it is made from, the others are its parts."""
