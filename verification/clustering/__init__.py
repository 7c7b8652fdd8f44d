"""Events of known families and clusters."""
