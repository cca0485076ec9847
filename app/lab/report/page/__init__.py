"""The page of a report: its parts, tables and markup."""
