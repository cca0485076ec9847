"""Work beside the window: threads, child processes, kernels, logs."""
