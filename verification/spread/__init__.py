"""What a catalogue's spread consists of: chance, ways of loading, cells, closeness, as variances."""
