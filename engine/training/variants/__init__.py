"""Other decisions than those of the product's method: what ablations, baselines and the published scheme train."""
