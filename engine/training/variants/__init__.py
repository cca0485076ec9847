"""Other decisions than those of the product's method, for ablations, baselines and the published scheme."""
