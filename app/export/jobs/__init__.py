"""What exports can be asked for: one declaration per job, from which command line, form and scripts follow."""
