"""The program's knowledge and actions."""
