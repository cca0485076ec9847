"""What all kernels share: vector lanes, routines, threads, memory, and where compiled code is kept."""
