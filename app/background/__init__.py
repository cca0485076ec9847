"""Work next to the window: threads, child processes, kernels, logs."""
