"""A scene on its grid: what holds each cell, particles, nodes of narrow openings, and the state that mining changes."""
