"""The timeline: transport row, overview, ruler and lanes of what is known of each frame and clip. One file per part;
`panel` puts them together.
"""
