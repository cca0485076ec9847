"""Jobs for schedulers, each of which trains a project's clips by one command per clip."""
