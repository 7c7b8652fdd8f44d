"""Every statistic of a catalogue against known truth."""
