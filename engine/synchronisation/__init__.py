"""How far the cameras of a capture are ahead of each other, measured from what their recordings have in common."""
