"""What every grid must keep: patch tests, totals, operator."""
