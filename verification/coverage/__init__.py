"""Coverage of the stated intervals in cases as mines have them."""
