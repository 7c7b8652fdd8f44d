"""Tables of the study's page, which are those of Coulomb rock."""

from verification.plastic.on_page import TABLES

__all__ = ["TABLES"]
