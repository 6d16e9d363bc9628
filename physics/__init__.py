"""Whether it works: the PyBullet world, vehicles, guidance, sensing, faults; `Trace` and `Report`."""
