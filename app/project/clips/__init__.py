"""The files of a project's clips: names, state, versions, exchange."""
