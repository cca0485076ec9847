"""The capture doctor: looks at a capture before anything is trained, and says what is wrong with it and what helps."""
