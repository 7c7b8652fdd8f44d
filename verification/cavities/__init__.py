"""Round cavities: closed forms of tunnels and spheres, and computed states in the coordinates of these forms."""
