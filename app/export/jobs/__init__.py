"""The kinds of export: one declaration per job, from which command line, form and scripts follow."""
