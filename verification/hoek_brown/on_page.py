"""What the page of the study sets side by side: as for Coulomb rock."""

from verification.plastic.on_page import TABLES

__all__ = ["TABLES"]
