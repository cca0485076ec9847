"""Subcommands that write add-ons for other programs."""
