"""Times of points, sweeps and threads; how they grow, and how far they are from a floor."""
