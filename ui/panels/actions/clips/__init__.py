"""Actions on clips: training, versions and cuts, mending."""
