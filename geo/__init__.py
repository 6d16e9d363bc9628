"""What the world is: frame, GeoJSON to `Scenario`, geometry checks, grids, shortest paths around obstacles."""
