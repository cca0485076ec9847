"""What the export dialog asks for each kind of export, and the jobs that the answers make."""
