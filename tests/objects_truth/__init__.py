"""Generated captures of people and a ball with known masks, for measuring how well objects are followed.

`make_object_scene` says what happens in a scene, `write_object_capture` writes it as a folder that the program opens,
with the mask of every object in a few cameras beside it, and `read_truth` reads those back.
"""
