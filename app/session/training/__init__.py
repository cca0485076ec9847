"""Training as the window sees it: the live clip, the queue, versions of clips, notices."""
