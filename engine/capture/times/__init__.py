"""When frames were taken: clocks, times, moments that several cameras share."""
