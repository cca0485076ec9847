"""What clips are made of: training, versions and cuts, mending."""
